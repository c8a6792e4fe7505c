//! Published values and tables that no formula gives.

/// Chung and Ooi (2011), test 4: incidence from the normal [deg], published tangential restitution e_t [-], and e_t of
/// the `total` tangential spring at the full Mindlin stiffness (own calculation, independent of this code).
pub(super) const TEST_4_STICKING: [(f64, f64, f64); 5] =
    [(5.0, 0.948, 0.9528), (10.0, 0.687, 0.6980), (15.0, 0.624, 0.6299), (20.0, 0.616, 0.6201), (25.0, 0.634, 0.6381)];

/// Realised against asked restitution with the no-attraction cut-off, the same for the linear law and Hertz.
/// After Schwager and Poeschel (2007), tabulated to four digits.
pub(super) const CUT_OFF: [(f64, f64); 11] = [
    (0.1, 0.2527),
    (0.2, 0.3249),
    (0.3, 0.3971),
    (0.4, 0.4720),
    (0.5, 0.5503),
    (0.6, 0.6323),
    (0.7, 0.7182),
    (0.8, 0.8081),
    (0.9, 0.9020),
    (0.95, 0.9505),
    (0.98, 0.9801),
];

#[cfg(test)]
mod tests {
    use super::super::reference::{
        HertzContact, ObliqueImpact, Tangential, cut_off_restitution, oblique_rebound, sphere_mass,
    };

    #[test]
    fn the_cut_off_table_is_its_formula() {
        for (asked, realised) in super::CUT_OFF {
            assert!((cut_off_restitution(asked) - realised).abs() < 1e-4, "{asked}: {}", cut_off_restitution(asked));
        }
    }

    #[test]
    fn the_column_of_the_total_spring_follows_from_its_equation_of_motion() {
        let (e, nu, r) = (3.8e11, 0.23, 2.5e-3);
        let shear = e / (2.0 * (1.0 + nu)) / (2.0 - nu);
        let contact = HertzContact { modulus: e / (1.0 - nu * nu), radius: r, mass: sphere_mass(r, 4000.0) };
        let impact = ObliqueImpact {
            contact,
            shear_modulus: shear,
            restitution: 0.98,
            friction: 0.092,
            law: Tangential::Total,
            arm_shortening: 0.0,
        };
        for (degrees, _, total) in super::TEST_4_STICKING {
            let angle = f64::to_radians(degrees);
            let rebound = oblique_rebound(&impact, 3.9 * angle.cos(), 3.9 * angle.sin());
            let e_t = rebound.tangential_velocity / (3.9 * angle.sin());
            // four digits, rounded
            assert!((e_t - total).abs() < 1e-4, "{degrees}: {e_t} against {total}");
        }
    }
}
