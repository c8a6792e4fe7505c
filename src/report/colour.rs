//! Colours that everybody can tell apart, on screen and in grey print.

/// A colour: red, green, blue.
pub type Colour = [u8; 3];

/// Ten anchors of the viridis map, evenly spaced (van der Walt and Smith 2015, released to the public domain).
const VIRIDIS: [Colour; 10] = [
    [0x44, 0x01, 0x54],
    [0x48, 0x28, 0x78],
    [0x3e, 0x49, 0x89],
    [0x31, 0x68, 0x8e],
    [0x26, 0x82, 0x8e],
    [0x1f, 0x9e, 0x89],
    [0x35, 0xb7, 0x79],
    [0x6e, 0xce, 0x58],
    [0xb5, 0xde, 0x2b],
    [0xfd, 0xe7, 0x25],
];

/// Colours of series for colour-blind readers (Okabe and Ito 2008), without black and the pale yellow.
const SERIES: [Colour; 6] = [
    [0x00, 0x72, 0xb2],
    [0xd5, 0x5e, 0x00],
    [0x00, 0x9e, 0x73],
    [0xcc, 0x79, 0xa7],
    [0xe6, 0x9f, 0x00],
    [0x56, 0xb4, 0xe9],
];

/// Colour of a magnitude, `share` from 0 (dark violet) to 1 (yellow); perceived lightness rises evenly.
#[must_use]
pub fn magnitude(share: f64) -> Colour {
    let place = if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) } * (VIRIDIS.len() - 1) as f64;
    let below = (place as usize).min(VIRIDIS.len() - 2);
    let mix = |channel: usize| {
        let (a, b) = (f64::from(VIRIDIS[below][channel]), f64::from(VIRIDIS[below + 1][channel]));
        (a + (place - below as f64) * (b - a)).round() as u8
    };
    [mix(0), mix(1), mix(2)]
}

/// Colour of series `number`; they repeat after six.
#[must_use]
pub fn series(number: usize) -> Colour {
    SERIES[number % SERIES.len()]
}

/// `#rrggbb`.
#[must_use]
pub fn hexadecimal(colour: Colour) -> String {
    format!("#{:02x}{:02x}{:02x}", colour[0], colour[1], colour[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance of an sRGB colour (IEC 61966-2-1).
    fn luminance(colour: Colour) -> f64 {
        let linear = colour.map(|c| {
            let c = f64::from(c) / 255.0;
            if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        });
        0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    }

    #[test]
    fn magnitudes_get_lighter_all_the_way() {
        let lightness: Vec<f64> = (0..=100).map(|k| luminance(magnitude(f64::from(k) / 100.0))).collect();
        assert!(lightness.windows(10).all(|w| w[9] > w[0]));
    }

    #[test]
    fn out_of_range_is_the_nearest_end() {
        assert_eq!(magnitude(-1.0), VIRIDIS[0]);
        assert_eq!(magnitude(7.0), VIRIDIS[9]);
        assert_eq!(magnitude(f64::NAN), VIRIDIS[0]);
        assert_eq!(hexadecimal(magnitude(1.0)), "#fde725");
    }
}
