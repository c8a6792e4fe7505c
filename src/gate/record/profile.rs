//! Where behind the plane the flow is free: the share of particles in contact against the distance.

use serde::Serialize;

/// A bin of the profile.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FreeFlowBin {
    /// Middle of the bin behind the plane [m].
    pub distance_m: f64,
    /// Particles seen in it, each time one is seen.
    pub samples: u64,
    /// Share of them with a contact force [-].
    pub contact_share: f64,
}

/// Counts of particles and of particles in contact by distance.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeFlowProfile {
    width: f64,
    /// (seen, in contact) of each bin.
    pub(super) counts: Vec<[u64; 2]>,
}

impl FreeFlowProfile {
    /// Bins of a quarter of the largest diameter [m] up to `length` [m]; the last one may reach beyond.
    #[must_use]
    pub fn new(length: f64, largest_diameter: f64) -> Self {
        let width = largest_diameter / 4.0;
        // The tolerance keeps a quotient that is whole up to round-off from starting an empty bin.
        let bins = (length / width - 1e-9).ceil().max(1.0) as usize;
        Self { width, counts: vec![[0, 0]; bins] }
    }

    /// Counts a particle at `distance` [m] behind the plane.
    pub fn count(&mut self, distance: f64, in_contact: bool) {
        if distance >= 0.0
            && let Some(bin) = self.counts.get_mut((distance / self.width) as usize)
        {
            bin[0] += 1;
            bin[1] += u64::from(in_contact);
        }
    }

    /// The profile; bins without any particle are left out.
    #[must_use]
    pub fn bins(&self) -> Vec<FreeFlowBin> {
        let bin = |(index, &[samples, touching]): (usize, &[u64; 2])| FreeFlowBin {
            distance_m: (index as f64 + 0.5) * self.width,
            samples,
            contact_share: touching as f64 / samples as f64,
        };
        self.counts.iter().enumerate().filter(|(_, count)| count[0] > 0).map(bin).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_by_distance_and_leaves_out_what_is_elsewhere() {
        let mut profile = FreeFlowProfile::new(0.006, 0.004);
        assert_eq!(profile.counts.len(), 6);
        for (distance, touches) in [(-1e-9, true), (0.0, true), (0.0009, false), (0.0059, false), (0.0061, true)] {
            profile.count(distance, touches);
        }
        let bins = profile.bins();
        assert_eq!(bins.len(), 2);
        assert_eq!((bins[0].distance_m, bins[0].samples, bins[0].contact_share), (0.0005, 2, 0.5));
        assert_eq!((bins[1].distance_m, bins[1].samples, bins[1].contact_share), (0.0055, 1, 0.0));
    }
}
