//! Named indices of refraction, with the names and numbers of Mitsuba 3.9.1 (measured from it; for metals, what it makes of
//! the measured spectra in its RGB variants).

use crate::math::Rgb;

/// The index of refraction of a dielectric by name.
pub fn dielectric(name: &str) -> Option<f32> {
    DIELECTRICS.iter().find(|(n, _)| *n == name).map(|(_, v)| *v)
}

/// Complex index of refraction `(eta, k)` of a metal by name. `"none"` is a perfect mirror.
pub fn conductor(name: &str) -> Option<(Rgb, Rgb)> {
    CONDUCTORS.iter().find(|(n, _, _)| *n == name).map(|(_, eta, k)| (*eta, *k))
}

/// Every name [`dielectric`] knows, with its index of refraction.
pub const DIELECTRICS: &[(&str, f32)] = &[
    ("vacuum", 1.0),
    ("helium", 1.000036),
    ("hydrogen", 1.000132),
    ("air", 1.000277),
    ("carbon dioxide", 1.00045),
    ("water", 1.333),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("carbon tetrachloride", 1.461),
    ("glycerol", 1.4729),
    ("benzene", 1.501),
    ("silicone oil", 1.52045),
    ("bromine", 1.661),
    ("water ice", 1.31),
    ("fused quartz", 1.458),
    ("pyrex", 1.47),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("bk7", 1.5046),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.575),
    ("diamond", 2.419),
];

/// Every name [`conductor`] knows, with `eta` and `k`.
pub const CONDUCTORS: &[(&str, Rgb, Rgb)] = &[
    ("none", Rgb::BLACK, Rgb::WHITE),
    ("Ag", Rgb::new(0.155276, 0.116728, 0.138388), Rgb::new(4.82835, 3.12222, 2.1469)),
    ("Al", Rgb::new(1.6575, 0.880405, 0.521244), Rgb::new(9.22381, 6.2695, 4.837)),
    ("AlAs", Rgb::new(3.6053, 3.23294, 2.21632), Rgb::new(0.000679437, 0.0, 0.00751271)),
    ("AlAs_palik", Rgb::new(3.6053, 3.23294, 2.21632), Rgb::new(0.000679437, 0.0, 0.00751271)),
    ("AlSb", Rgb::new(0.0, 4.13937, 4.66925), Rgb::new(0.0, 0.0940091, 1.30057)),
    ("AlSb_palik", Rgb::new(0.0, 4.13937, 4.66925), Rgb::new(0.0, 0.0940091, 1.30057)),
    ("Au", Rgb::new(0.143036, 0.375307, 1.44205), Rgb::new(3.983, 2.38556, 1.60336)),
    ("Be", Rgb::new(4.18501, 3.18503, 2.78406), Rgb::new(3.83547, 3.01012, 2.86899)),
    ("Be_palik", Rgb::new(4.18501, 3.18503, 2.78406), Rgb::new(3.83547, 3.01012, 2.86899)),
    ("Cr", Rgb::new(4.36967, 2.91651, 1.6549), Rgb::new(5.20655, 4.23131, 3.7547)),
    ("CsI", Rgb::new(2.1449, 1.70232, 1.66243), Rgb::new(0.0, 0.0, 0.0)),
    ("CsI_palik", Rgb::new(2.1449, 1.70232, 1.66243), Rgb::new(0.0, 0.0, 0.0)),
    ("Cu", Rgb::new(0.201005, 0.92375, 1.10222), Rgb::new(3.91326, 2.45305, 2.14209)),
    ("Cu2O", Rgb::new(3.55177, 2.94987, 2.75188), Rgb::new(0.114207, 0.193897, 0.606134)),
    ("Cu2O_palik", Rgb::new(3.55177, 2.94987, 2.75188), Rgb::new(0.114207, 0.193897, 0.606134)),
    ("CuO", Rgb::new(3.24754, 2.44781, 2.21022), Rgb::new(0.52109, 0.570031, 0.722179)),
    ("CuO_palik", Rgb::new(3.24754, 2.44781, 2.21022), Rgb::new(0.52109, 0.570031, 0.722179)),
    ("Cu_palik", Rgb::new(0.213229, 0.919715, 1.10241), Rgb::new(3.92187, 2.45733, 2.13658)),
    ("Hg", Rgb::new(2.39894, 1.44003, 0.90957), Rgb::new(6.32759, 4.37193, 3.42176)),
    ("HgTe", Rgb::new(4.77904, 3.2312, 2.6599), Rgb::new(1.63161, 1.58081, 1.72929)),
    ("HgTe_palik", Rgb::new(4.77904, 3.2312, 2.6599), Rgb::new(1.63161, 1.58081, 1.72929)),
    ("Hg_palik", Rgb::new(2.39894, 1.44003, 0.90957), Rgb::new(6.32759, 4.37193, 3.42176)),
    ("Ir", Rgb::new(3.0863, 2.08219, 1.61791), Rgb::new(5.59215, 4.06709, 3.26731)),
    ("Ir_palik", Rgb::new(3.0863, 2.08219, 1.61791), Rgb::new(5.59215, 4.06709, 3.26731)),
    ("K", Rgb::new(0.0640432, 0.0464098, 0.0381849), Rgb::new(2.1042, 1.34894, 0.913126)),
    ("K_palik", Rgb::new(0.0640432, 0.0464098, 0.0381849), Rgb::new(2.1042, 1.34894, 0.913126)),
    ("Li", Rgb::new(0.265791, 0.195618, 0.220949), Rgb::new(3.54015, 2.31112, 1.66861)),
    ("Li_palik", Rgb::new(0.265791, 0.195618, 0.220949), Rgb::new(3.54015, 2.31112, 1.66861)),
    ("MgO", Rgb::new(2.08958, 1.65072, 1.59488), Rgb::new(0.0, 0.0, 0.0)),
    ("MgO_palik", Rgb::new(2.08958, 1.65072, 1.59488), Rgb::new(0.0, 0.0, 0.0)),
    ("Mo", Rgb::new(4.48397, 3.52513, 2.77631), Rgb::new(4.11144, 3.42083, 3.15061)),
    ("Mo_palik", Rgb::new(4.48397, 3.52513, 2.77631), Rgb::new(4.11144, 3.42083, 3.15061)),
    ("Na_palik", Rgb::new(0.0602694, 0.0561409, 0.0619884), Rgb::new(3.17927, 2.11249, 1.57904)),
    ("Nb", Rgb::new(3.42007, 2.79009, 2.39563), Rgb::new(3.44139, 2.73767, 2.57975)),
    ("Nb_palik", Rgb::new(3.42007, 2.79009, 2.39563), Rgb::new(3.44139, 2.73767, 2.57975)),
    ("Ni_palik", Rgb::new(2.3673, 1.66337, 1.46708), Rgb::new(4.49881, 3.05015, 2.34544)),
    ("Rh", Rgb::new(2.58579, 1.86022, 1.55426), Rgb::new(6.78226, 4.70299, 3.97607)),
    ("Rh_palik", Rgb::new(2.58579, 1.86022, 1.55426), Rgb::new(6.78226, 4.70299, 3.97607)),
    ("Se", Rgb::new(4.05831, 2.84294, 2.82085), Rgb::new(0.75405, 0.638444, 0.521808)),
    ("Se-e", Rgb::new(5.72285, 4.16574, 4.08134), Rgb::new(0.871136, 1.10516, 1.56532)),
    ("Se-e_palik", Rgb::new(5.72285, 4.16574, 4.08134), Rgb::new(0.871136, 1.10516, 1.56532)),
    ("Se_palik", Rgb::new(4.05831, 2.84294, 2.82085), Rgb::new(0.75405, 0.638444, 0.521808)),
    ("SiC", Rgb::new(3.17234, 2.52597, 2.47937), Rgb::new(7.53766e-07, 0.0, 1.01925e-05)),
    ("SiC_palik", Rgb::new(3.17234, 2.52597, 2.47937), Rgb::new(7.53766e-07, 0.0, 1.01925e-05)),
    ("SnTe", Rgb::new(4.52425, 1.98165, 1.28159), Rgb::new(0.0, 0.0, 0.0)),
    ("SnTe_palik", Rgb::new(4.52425, 1.98165, 1.28159), Rgb::new(0.0, 0.0, 0.0)),
    ("Ta", Rgb::new(2.06272, 2.39294, 2.62793), Rgb::new(2.40836, 1.74149, 1.94703)),
    ("Ta_palik", Rgb::new(2.06272, 2.39294, 2.62793), Rgb::new(2.40836, 1.74149, 1.94703)),
    ("Te", Rgb::new(7.39023, 4.4821, 2.63711), Rgb::new(3.25602, 3.52706, 3.29205)),
    ("Te-e", Rgb::new(7.50891, 4.29643, 2.36999), Rgb::new(5.58393, 4.94721, 3.99759)),
    ("Te-e_palik", Rgb::new(7.50891, 4.29643, 2.36999), Rgb::new(5.58393, 4.94721, 3.99759)),
    ("Te_palik", Rgb::new(7.39023, 4.4821, 2.63711), Rgb::new(3.25602, 3.52706, 3.29205)),
    ("ThF4", Rgb::new(1.83071, 1.44223, 1.38765), Rgb::new(0.0, 0.0, 0.0)),
    ("ThF4_palik", Rgb::new(1.83071, 1.44223, 1.38765), Rgb::new(0.0, 0.0, 0.0)),
    ("TiC", Rgb::new(3.70053, 2.83742, 2.58229), Rgb::new(3.26564, 2.35159, 2.17279)),
    ("TiC_palik", Rgb::new(3.70053, 2.83742, 2.58229), Rgb::new(3.26564, 2.35159, 2.17279)),
    ("TiN", Rgb::new(1.64845, 1.15052, 1.37982), Rgb::new(3.36833, 1.9435, 1.10207)),
    ("TiN_palik", Rgb::new(1.64845, 1.15052, 1.37982), Rgb::new(3.36833, 1.9435, 1.10207)),
    ("TiO2", Rgb::new(3.45661, 2.80174, 2.90517), Rgb::new(0.000105265, 0.0, 0.000652887)),
    ("TiO2-e", Rgb::new(3.10656, 2.51317, 2.58244), Rgb::new(2.97516e-05, 0.0, 0.000182698)),
    ("TiO2-e_palik", Rgb::new(3.10656, 2.51317, 2.58244), Rgb::new(2.97516e-05, 0.0, 0.000182698)),
    ("TiO2_palik", Rgb::new(3.45661, 2.80174, 2.90517), Rgb::new(0.000105265, 0.0, 0.000652887)),
    ("VC", Rgb::new(3.65757, 2.75274, 2.53267), Rgb::new(3.0683, 2.19869, 1.96319)),
    ("VC_palik", Rgb::new(3.65757, 2.75274, 2.53267), Rgb::new(3.0683, 2.19869, 1.96319)),
    ("VN", Rgb::new(2.8656, 2.11919, 1.94009), Rgb::new(3.03224, 2.05612, 1.61631)),
    ("VN_palik", Rgb::new(2.8656, 2.11919, 1.94009), Rgb::new(3.03224, 2.05612, 1.61631)),
    ("V_palik", Rgb::new(4.27758, 3.51295, 2.76107), Rgb::new(3.4913, 2.88945, 3.11152)),
    ("W", Rgb::new(4.37082, 3.30025, 2.99841), Rgb::new(3.50064, 2.60487, 2.27323)),
    ("a-C", Rgb::new(2.94405, 2.22714, 1.96816), Rgb::new(0.887465, 0.799299, 0.81529)),
    ("d-C", Rgb::new(2.70872, 2.31883, 2.2289), Rgb::new(0.0, 0.0, 0.0)),
    ("d-C_palik", Rgb::new(2.70872, 2.31883, 2.2289), Rgb::new(0.0, 0.0, 0.0)),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_once() {
        for (name, value) in DIELECTRICS {
            assert_eq!(dielectric(name), Some(*value));
            assert_eq!(DIELECTRICS.iter().filter(|(n, _)| n == name).count(), 1);
        }
        for (name, eta, k) in CONDUCTORS {
            assert_eq!(conductor(name), Some((*eta, *k)));
            assert_eq!(CONDUCTORS.iter().filter(|(n, _, _)| n == name).count(), 1);
        }
        assert_eq!(dielectric("glass"), None);
        assert_eq!(conductor("Unobtainium"), None);
        assert_eq!(conductor("Al_palik"), None);
        assert_ne!(conductor("Cu_palik"), conductor("Cu"));
    }
}
