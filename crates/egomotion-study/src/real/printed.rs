//! The values that the paper prints in Tables 3 to 7, which stand beside ours.
//!
//! Signs are ours: where Tables 3 and 6 print −VZ (E to M) the errors in percent are the same for either sign.

/// VZ of one sequence in Table 3 or 6.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PrintedDepthVelocity {
    /// The sequence's letter.
    pub(super) letter: &'static str,
    /// (DCCE, DV) estimated −VZ in mm per frame; `None` where VZ varies from point to point.
    pub(super) estimated_mm: Option<[f64; 2]>,
    /// True −VZ in mm per frame; that of M is printed as ≈5.
    pub(super) true_mm: Option<f64>,
    /// (DCCE, DV) ERM in percent.
    pub(super) erm_percent: [f64; 2],
    /// (DCCE, DV) STD in percent.
    pub(super) std_percent: [f64; 2],
}

/// φ of one sequence, as (tX, tY, tZ) in mm and (ΩX, ΩY, ΩZ) in degrees per frame.
pub(super) type MmDeg = [f64; 6];

/// φ of one sequence by both methods in Table 4 or 5.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PrintedMotion {
    /// The sequence's letter.
    pub(super) letter: &'static str,
    /// φ by DCCE.
    pub(super) dcce: MmDeg,
    /// φ by DV.
    pub(super) dv: MmDeg,
}

const fn varying(letter: &'static str, erm_percent: [f64; 2], std_percent: [f64; 2]) -> PrintedDepthVelocity {
    PrintedDepthVelocity { letter, estimated_mm: None, true_mm: None, erm_percent, std_percent }
}

const fn constant(
    letter: &'static str,
    estimated: [f64; 2],
    truth: f64,
    erm_percent: [f64; 2],
    std_percent: [f64; 2],
) -> PrintedDepthVelocity {
    PrintedDepthVelocity {
        letter,
        estimated_mm: Some(estimated),
        true_mm: Some(truth),
        erm_percent,
        std_percent,
    }
}

/// Table 3: VZ, differential approach.
pub(super) const TABLE_3: [PrintedDepthVelocity; 12] = [
    varying("A", [586.98, 3010.7], [1898.5, 8178.7]),
    varying("B", [216.85, 1573.8], [574.38, 5024.4]),
    varying("C", [290.18, 1698.0], [782.49, 4990.3]),
    varying("D", [230.60, 722.29], [560.62, 2204.5]),
    constant("E", [0.556, 1.048], 1.0, [-44.39, 4.75], [1715.6, 714.22]),
    constant("F", [5.491, 8.022], 5.0, [9.82, 60.45], [250.51, 211.29]),
    constant("G", [6.520, 10.391], 10.0, [-34.80, 3.91], [182.69, 110.53]),
    constant("H", [12.763, 17.374], 20.0, [-36.18, -13.13], [182.83, 85.36]),
    constant("I", [40.765, 34.918], 40.0, [1.91, 12.71], [128.47, 102.15]),
    constant("J", [10.427, 16.043], 10.0, [4.27, 60.43], [138.94, 153.78]),
    constant("L", [21.621, 27.251], 20.0, [8.10, 36.26], [83.09, 116.79]),
    constant("M", [3.097, 3.549], 5.0, [-38.06, -29.03], [4159.1, 4413.0]),
];

/// Table 6: VZ, discrete approach.
pub(super) const TABLE_6: [PrintedDepthVelocity; 12] = [
    varying("A", [775.11, 2599.6], [2296.3, 6407.0]),
    varying("B", [376.49, 1011.5], [1012.6, 2550.2]),
    varying("C", [396.40, 751.63], [1012.9, 1806.6]),
    varying("D", [210.73, 514.37], [474.67, 1207.8]),
    constant("E", [0.823, 3.131], 1.0, [-17.68, 213.08], [1220.5, 649.67]),
    constant("F", [5.205, 6.437], 5.0, [4.09, 28.73], [225.14, 130.09]),
    constant("G", [6.547, 6.824], 10.0, [-34.53, -31.77], [156.48, 54.29]),
    constant("H", [12.991, 13.532], 20.0, [-35.04, -32.34], [176.97, 64.05]),
    constant("I", [43.513, 43.034], 40.0, [8.78, 7.58], [123.43, 37.45]),
    constant("J", [11.395, 11.121], 10.0, [13.05, 11.21], [151.52, 83.39]),
    constant("L", [24.444, 18.578], 20.0, [22.22, -7.11], [80.90, 54.99]),
    constant("M", [4.910, 6.705], 5.0, [-1.81, 34.10], [348.90, 327.04]),
];

const fn phi(letter: &'static str, dcce: MmDeg, dv: MmDeg) -> PrintedMotion {
    PrintedMotion { letter, dcce, dv }
}

/// Tables 4 (A to D) and 5 (E to M): φ, differential approach.
///
/// tX of D by DCCE is printed "−222–20", which is read here as −222.20.
pub(super) const TABLES_4_5: [PrintedMotion; 12] = [
    phi("A", [249.90, 15.01, 0.67, 0.041, -0.160, 0.069], [12.10, 2.79, -0.15, 0.074, -0.224, -0.038]),
    phi("B", [258.62, 57.05, -1.81, -0.018, -0.124, 16.936], [-24.81, -72.52, -5.49, -2.455, 0.860, -0.128]),
    phi("C", [-621.67, -99.28, 2.86, 0.842, 0.786, -16.819], [-10.76, -58.70, -4.26, -1.352, 0.208, 0.531]),
    phi("D", [-222.20, 0.0, 11.05, 0.606, -0.187, -0.781], [-45.91, -36.72, -13.70, -0.889, 1.159, 0.488]),
    phi("E", [-9.66, 6.23, -0.71, -0.003, -0.013, 2.096], [-4.32, -0.45, -1.77, -0.015, 0.083, 0.008]),
    phi("F", [-30.41, 21.64, -4.11, -0.018, 0.038, 0.696], [-4.88, -8.41, -7.12, -0.194, 0.126, 0.173]),
    phi("G", [-27.60, 1.05, -6.14, -0.006, -0.013, 2.275], [-7.41, -1.88, -10.73, -0.085, 0.207, 0.045]),
    phi("H", [-99.25, -70.17, -12.78, 0.067, -0.071, 4.660], [-31.39, 10.60, -18.86, 0.234, 0.874, -0.122]),
    phi(
        "I",
        [-118.76, -130.54, -38.49, -0.515, 0.020, -0.252],
        [-110.39, -6.64, -40.00, -0.303, 2.344, -0.148],
    ),
    phi("J", [-42.65, 86.22, -10.16, -0.115, 0.042, 1.574], [-5.78, -28.29, -15.86, -0.475, 0.141, 0.228]),
    phi(
        "L",
        [-243.77, 351.56, -19.41, -0.215, -0.029, 22.193],
        [-61.79, -61.04, -28.10, -1.068, 1.333, 1.030],
    ),
    phi("M", [-296.22, 78.99, -5.94, -0.140, 0.130, -8.490], [25.71, 110.80, 8.35, 2.436, 0.702, -1.122]),
];

/// Table 7: φ, discrete approach, which is one estimate from (22).
pub(super) const TABLE_7: [(&str, MmDeg); 12] = [
    ("A", [1.59, 1.52, 0.00, 0.200, -0.118, 0.017]),
    ("B", [0.97, -10.75, 7.99, -0.138, -0.323, -0.226]),
    ("C", [-17.66, 18.13, 233.35, 0.607, 1.395, 0.105]),
    ("D", [-15.28, 35.49, 136.00, 0.800, 2.683, 0.461]),
    ("E", [-3.39, 0.07, 4.90, 0.185, 0.207, 0.028]),
    ("F", [-3.52, -0.54, 5.32, 0.169, 0.179, 0.016]),
    ("G", [-2.01, -1.84, -12.18, 0.105, 0.164, 0.022]),
    ("H", [3.62, -3.46, -28.53, -0.081, 0.107, -0.006]),
    ("I", [-5.74, -2.29, -44.91, 0.164, 0.340, -0.096]),
    ("J", [-2.74, -0.19, -12.13, 0.093, 0.235, -0.006]),
    ("L", [-0.15, 6.44, -17.83, 0.156, 0.201, 0.067]),
    ("M", [-5.42, -3.99, -6.57, 0.050, 0.319, 0.010]),
];

#[cfg(test)]
mod tests {
    use super::*;
    use egomotion::sim::Sequence;

    #[test]
    fn printed_errors_are_those_of_the_printed_estimates() {
        let mut misprints = Vec::new();
        for row in TABLE_3.iter().chain(&TABLE_6) {
            let (Some(estimated), Some(truth)) = (row.estimated_mm, row.true_mm) else { continue };
            for (estimate, erm) in estimated.into_iter().zip(row.erm_percent) {
                let computed = 100.0 * (estimate - truth) / truth;
                // Estimates are printed to 0.0005 mm, which is 0.05 % of 1 mm.
                if (computed - erm).abs() > 0.055 {
                    misprints.push((row.letter, erm));
                }
            }
        }
        // −12.71 without its sign, and 13.95 with a wrong digit.
        assert_eq!(misprints, [("I", 12.71), ("J", 13.05)]);
    }

    #[test]
    fn every_table_has_the_sequences_of_the_lab_in_order() {
        let letters: Vec<&str> = Sequence::lab_names().map(|name| &name[4..]).collect();
        assert_eq!(TABLE_3.map(|row| row.letter).to_vec(), letters);
        assert_eq!(TABLE_6.map(|row| row.letter).to_vec(), letters);
        assert_eq!(TABLES_4_5.map(|row| row.letter).to_vec(), letters);
        assert_eq!(TABLE_7.map(|row| row.0).to_vec(), letters);
    }
}
