//! Student's t distribution, by the regularised incomplete beta function.

/// Coefficients of Lanczos' approximation of the gamma function, g = 7, nine terms (Lanczos 1964; values as commonly
/// tabulated for double precision).
const LANCZOS: [f64; 9] = [
    0.999_999_999_999_809_9,
    676.520_368_121_885_1,
    -1_259.139_216_722_402_8,
    771.323_428_777_653_1,
    -176.615_029_162_140_6,
    12.507_343_278_686_905,
    -0.138_571_095_265_720_12,
    9.984_369_578_019_572e-6,
    1.505_632_735_149_311_6e-7,
];
/// Degrees of freedom above which the distribution is taken at this number of them: quantiles move by less than 1e-6.
const MOST_DEGREES: f64 = 1e7;
/// Steps after which the continued fraction is as good as it gets; it needs about sqrt(max(a, b)).
const MOST_STEPS: usize = 20_000;

/// Logarithm of the gamma function, ln G(x) for x > 0   [-]
///
/// Relative error about 1e-15 (Lanczos 1964).
#[must_use]
pub fn ln_gamma(x: f64) -> f64 {
    if x < 0.5 {
        // Reflection: G(x) G(1 - x) = pi / sin(pi x).
        return (std::f64::consts::PI / (std::f64::consts::PI * x).sin()).ln() - ln_gamma(1.0 - x);
    }
    let x = x - 1.0;
    let base = x + 7.5;
    let sum = LANCZOS.iter().enumerate().skip(1).fold(LANCZOS[0], |sum, (k, c)| sum + c / (x + k as f64));
    0.5 * std::f64::consts::TAU.ln() + (x + 0.5) * base.ln() - base + sum.ln()
}

/// Regularised incomplete beta function I_x(a, b) for a, b > 0 and 0 <= x <= 1   [-]
///
/// By its continued fraction (Abramowitz and Stegun 1964, 26.5.8), evaluated from the front by the method of Lentz (1976),
/// with I_x(a, b) = 1 - I_{1-x}(b, a) where that converges faster.
#[must_use]
pub fn incomplete_beta(a: f64, b: f64, x: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return x.clamp(0.0, 1.0);
    }
    let front = (ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b) + a * x.ln() + b * (-x).ln_1p()).exp();
    if x < (a + 1.0) / (a + b + 2.0) {
        front * beta_fraction(a, b, x) / a
    } else {
        1.0 - front * beta_fraction(b, a, 1.0 - x) / b
    }
}

fn beta_fraction(a: f64, b: f64, x: f64) -> f64 {
    // A term that vanishes would end the recurrence; Lentz' method replaces it by something tiny.
    let safe = |term: f64| if term.abs() < f64::MIN_POSITIVE { f64::MIN_POSITIVE } else { term };
    let (mut c, mut d) = (1.0, 1.0 / safe(1.0 - (a + b) * x / (a + 1.0)));
    let mut fraction = d;
    for k in 1..MOST_STEPS {
        let m = k as f64;
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let mut change = 1.0;
        for coefficient in [even, odd] {
            d = 1.0 / safe(1.0 + coefficient * d);
            c = safe(1.0 + coefficient / c);
            change = c * d;
            fraction *= change;
        }
        if (change - 1.0).abs() < 2.0 * f64::EPSILON {
            break;
        }
    }
    fraction
}

/// Probability that Student's t with `degrees` of freedom > 0 is at most `t`   [-]
///
/// P = 1 - I_x(degrees / 2, 1 / 2) / 2 for t >= 0, x = degrees / (degrees + t^2) (Student 1908; Abramowitz and Stegun 1964,
/// 26.7.1).
#[must_use]
pub fn student_probability(t: f64, degrees: f64) -> f64 {
    let degrees = degrees.min(MOST_DEGREES);
    let square = t * t;
    let tail = if square < 1.0 {
        // The same as 1 - I_{1-x}(1 / 2, degrees / 2), which keeps the digits of a small t that 1 - x would lose.
        0.5 - 0.5 * incomplete_beta(0.5, 0.5 * degrees, square / (degrees + square))
    } else {
        0.5 * incomplete_beta(0.5 * degrees, 0.5, degrees / (degrees + square))
    };
    if t < 0.0 { tail } else { 1.0 - tail }
}

/// The t that Student's t with `degrees` of freedom > 0 does not exceed with `probability` (0 < probability < 1)   [-]
///
/// By Newton's method on [`student_probability`], kept inside a bracket that bisection narrows; `probability` in both tails
/// is found with the same relative accuracy, about 1e-12. Infinite `degrees` are those of the normal distribution.
#[must_use]
pub fn student_quantile(probability: f64, degrees: f64) -> f64 {
    if probability < 0.5 {
        return -student_quantile(1.0 - probability, degrees);
    }
    let degrees = degrees.min(MOST_DEGREES);
    let constant =
        ln_gamma(0.5 * (degrees + 1.0)) - ln_gamma(0.5 * degrees) - 0.5 * (degrees * std::f64::consts::PI).ln();
    let density = |t: f64| (constant - 0.5 * (degrees + 1.0) * (t * t / degrees).ln_1p()).exp();
    let (mut low, mut high) = (0.0, 1.0);
    while student_probability(high, degrees) < probability && high < 1e300 {
        (low, high) = (high, 2.0 * high);
    }
    let mut t = 0.5 * (low + high);
    for _ in 0..200 {
        let excess = student_probability(t, degrees) - probability;
        if excess > 0.0 {
            high = t
        } else {
            low = t
        }
        let newton = t - excess / density(t);
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - t).abs() <= 1e-14 * next.abs() {
            return next;
        }
        t = next;
    }
    t
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    #[test]
    fn gamma_of_whole_and_half_numbers() {
        let mut factorial = 1.0_f64;
        for n in 1..=20 {
            // G(n) = (n - 1)!; the logarithm near 0 leaves an absolute error.
            assert_relative_eq!(ln_gamma(f64::from(n)), factorial.ln(), max_relative = 1e-13, epsilon = 1e-14);
            factorial *= f64::from(n);
        }
        assert_relative_eq!(ln_gamma(0.5), PI.sqrt().ln(), max_relative = 1e-13);
        assert_relative_eq!(ln_gamma(0.25) + ln_gamma(0.75), (PI * 2f64.sqrt()).ln(), max_relative = 1e-13);
    }

    #[test]
    fn incomplete_beta_where_it_is_elementary() {
        for x in [1e-6, 0.1, 0.5, 0.9, 1.0 - 1e-9] {
            assert_relative_eq!(incomplete_beta(3.0, 1.0, x), x.powi(3), max_relative = 1e-12);
            assert_relative_eq!(incomplete_beta(1.0, 4.0, x), 1.0 - (1.0 - x).powi(4), max_relative = 1e-10);
            let arcsine = 2.0 / PI * x.sqrt().asin();
            // Near 1 the arcsine amplifies the rounding of its argument by 1 / sqrt(1 - x), 3e4 here.
            assert_relative_eq!(incomplete_beta(0.5, 0.5, x), arcsine, max_relative = 1e-11);
        }
    }

    /// Distribution functions in closed form for 1 to 4 degrees of freedom.
    fn closed_form(t: f64, degrees: u32) -> f64 {
        let x = t / f64::from(degrees).sqrt();
        match degrees {
            1 => 0.5 + t.atan() / PI,
            2 => 0.5 + t / (2.0 * (2.0 + t * t).sqrt()),
            3 => 0.5 + (x / (1.0 + x * x) + x.atan()) / PI,
            _ => 0.5 + 0.375 * t / (1.0 + x * x).sqrt() * (1.0 - x * x / (3.0 * (1.0 + x * x))),
        }
    }

    #[test]
    fn probabilities_of_few_degrees_have_closed_forms() {
        for degrees in 1..=4 {
            for t in [-7.5, -1.0, -0.1, 0.0, 0.3, 1.0, 2.0, 12.0] {
                let found = student_probability(t, f64::from(degrees));
                assert_relative_eq!(found, closed_form(t, degrees), epsilon = 1e-13);
            }
        }
        // Their inverses: tan(pi (p - 1/2)) and (2 p - 1) / sqrt(2 p (1 - p)).
        for p in [0.6, 0.9, 0.975, 0.9995] {
            assert_relative_eq!(student_quantile(p, 1.0), (PI * (p - 0.5)).tan(), max_relative = 1e-10);
            let second = (2.0 * p - 1.0) / (2.0 * p * (1.0 - p)).sqrt();
            assert_relative_eq!(student_quantile(p, 2.0), second, max_relative = 1e-10);
        }
    }

    #[test]
    fn quantiles_are_those_of_the_tables() {
        // Published tables of Student's t (two-sided 95 % and 99 %), to nine decimals; 1e-6 is what is asked here.
        let table = [
            (0.975, 5.0, 2.570_581_836),
            (0.975, 10.0, 2.228_138_852),
            (0.975, 18.0, 2.100_922_040),
            (0.975, 30.0, 2.042_272_456),
            (0.975, 120.0, 1.979_930_405),
            (0.975, f64::INFINITY, 1.959_963_985),
            (0.995, 5.0, 4.032_142_984),
            (0.995, 10.0, 3.169_272_673),
            (0.995, 30.0, 2.749_995_654),
            (0.95, 10.0, 1.812_461_123),
        ];
        for (probability, degrees, expected) in table {
            let found = student_quantile(probability, degrees);
            assert!((found - expected).abs() < 1e-6, "t({probability}, {degrees}) = {found}, not {expected}");
            assert_eq!(student_quantile(1.0 - probability, degrees) + found, 0.0, "symmetric up to 1 - (1 - p)");
        }
    }

    #[test]
    fn a_small_t_of_many_degrees_keeps_its_digits() {
        // P - 1/2 = t f(0) (1 - t^2 / 6 + ...), f(0) = G((n + 1) / 2) / (sqrt(n pi) G(n / 2)), which is (1 - 1 / 4n) / sqrt(2 pi) for large n.
        let (t, degrees) = (1e-4, 4e5);
        let expected = t * (1.0 - 0.25 / degrees) / (2.0 * PI).sqrt();
        // Terms left out: t^2 / 6 and 1 / 32 n^2. The front factor carries the rounding of ln G(2e5), 2e6 units of 1e-16.
        assert_relative_eq!(student_probability(t, degrees) - 0.5, expected, max_relative = 5e-9);
    }

    proptest! {
        #[test]
        fn a_quantile_has_its_probability(p in 0.001..0.999f64, degrees in 0.5..1e6f64) {
            let back = student_probability(student_quantile(p, degrees), degrees);
            // ln G of 1e6 has a rounding error of about 1e7 ulp, which enters the front factor.
            prop_assert!((back - p).abs() < 1e-8, "{back} {p}");
        }
    }
}
