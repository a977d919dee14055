//! The rendered sequences lab-A … lab-M: Tables 3 to 7 and Figures 11 to 14 with the paper's own values beside ours.

use super::figures::{self, PaperLines, Typical};
use super::speed::{SpeedAxis, SpeedPlace};
use super::tables::{self, DepthVelocityEntry, Heading, MEDIANS, MotionEntry};
use super::{Example, RealResults};
use crate::components::in_mm_deg;
use crate::real::contender::ImageContender;
use crate::real::printed::{PrintedDepthVelocity, TABLE_3, TABLE_6, TABLE_7, TABLES_4_5};
use crate::real::quantity::Quantity;
use crate::sequences::two_frames;
use crate::{Axis, Figure, Table};
use egomotion::pipeline::{Approach, Method};
use egomotion::sim::Sequence;

/// Letters of the sequences that translate along Z alone.
const TRANSLATING: [&str; 5] = ["E", "F", "G", "H", "I"];
/// Letters of the sequences that turn alone.
const TURNING: [&str; 4] = ["A", "B", "C", "D"];
/// What the methods get, at the end of the captions of figures.
const INPUT: &str = "Rendered images with the sensor's noise (variance 1.5² + 0.02 I grey levels); disparity matched in them and \
     rounded to 1/16 px, flow matched; means over 3 textures and 5 poses unless set otherwise.";

/// Name of the lab sequence of that letter.
fn lab_name(letter: &str) -> String {
    format!("lab-{letter}")
}

/// Letters of the lab sequences that have records, in the paper's order.
fn letters(results: &RealResults<'_>) -> Vec<&'static str> {
    let known = results.sequences();
    let letters = Sequence::lab_names().filter(|name| known.contains(name));
    letters.filter_map(|name| name.strip_prefix("lab-")).collect()
}

/// How fast a sequence is: |tZ| in mm per frame, or |ΩY| in degrees per frame where it only turns.
pub(super) fn speed(sequence: &str) -> Option<f64> {
    let phi = two_frames(sequence)?.phi_cyclopean(0)?;
    let (forward, turn) = (1e3 * phi.t.z.abs(), phi.omega.y.to_degrees().abs());
    Some(if forward > 0.0 { forward } else { turn })
}

/// How well the images were matched.
pub(super) fn matching(results: &RealResults<'_>) -> Table {
    let mut table = Table::new(
        "real-matching",
        "What the methods had to work with",
        "Median errors of computed disparity (before it is rounded) and of computed flow against the exact maps.",
        &[("sequence", "sequence"), ("disparity_px", "disparity (px)"), ("flow_px", "flow (px)")],
    );
    for letter in letters(results) {
        let median = |quantity| results.get(&lab_name(letter), None, quantity).map(|found| found.estimate);
        table.rows.push(vec![
            letter.into(),
            median(Quantity::Disparity).into(),
            median(Quantity::Flow).into(),
        ]);
    }
    table
}

/// Tables 3 to 7.
pub(super) fn printed(results: &RealResults<'_>) -> Vec<Table> {
    let turning = |letter: &str| TURNING.contains(&letter);
    let differential = Approach::Differential;
    vec![
        vz(results, "table-03", "Table 3. Estimation of VZ: differential approach", differential, &TABLE_3),
        phi(
            results,
            ("table-04", "Table 4. Estimation of φ, turning: differential approach"),
            differential,
            turning,
        ),
        phi(
            results,
            ("table-05", "Table 5. Estimation of φ, translating and mixed: differential approach"),
            differential,
            |letter| !turning(letter),
        ),
        vz(results, "table-06", "Table 6. Estimation of VZ: discrete approach", Approach::Discrete, &TABLE_6),
        phi(
            results,
            ("table-07", "Table 7. Estimation of φ: discrete approach"),
            Approach::Discrete,
            |_| true,
        ),
    ]
}

/// Table 3 or 6.
fn vz(
    results: &RealResults<'_>,
    id: &str,
    title: &str,
    approach: Approach,
    printed: &[PrintedDepthVelocity],
) -> Table {
    let letters = letters(results);
    let entry = |row| -> DepthVelocityEntry<'_> {
        let row: &PrintedDepthVelocity = row;
        DepthVelocityEntry {
            label: row.letter,
            sequence: lab_name(row.letter),
            constant: row.true_mm.is_some(),
            paper: Some(row),
            sources: &[("here", Quantity::Vz), ("here, anywhere", Quantity::VzAnywhere)],
        }
    };
    let entries: Vec<_> = printed.iter().filter(|row| letters.contains(&row.letter)).map(entry).collect();
    let caption = format!(
        "As in the paper: −VZ in mm per frame for E to M, whose ERM is signed; in A to D VZ varies from point to point \
         and ERM is absolute. \"Here\" counts pixels whose neighbours lie on one surface and which both cameras see, \
         \"here, anywhere\" all that were measured. The last column of each group is maximum likelihood, which \
         the paper did not have. {MEDIANS}"
    );
    tables::vz(results, Heading { id, title, caption: &caption }, approach, &entries)
}

/// Table 4, 5 or 7.
fn phi(
    results: &RealResults<'_>,
    (id, title): (&str, &str),
    approach: Approach,
    chosen: impl Fn(&str) -> bool,
) -> Table {
    let entry = |letter: &'static str| MotionEntry {
        label: letter,
        sequence: lab_name(letter),
        above: printed_rows(letter, approach),
    };
    let entries: Vec<_> = letters(results).into_iter().filter(|letter| chosen(letter)).map(entry).collect();
    let caption = "mm and degrees per frame, of the camera between the two. Ours: mean ± standard deviation from draw to draw \
         (median). The paper gives one estimate for each sequence, and does not say whether by least squares or by least \
         median of squares.";
    tables::phi(results, Heading { id, title, caption }, approach, &entries)
}

/// The truth and the paper's values of one sequence.
fn printed_rows(letter: &str, approach: Approach) -> Vec<(&'static str, [Option<f64>; 6])> {
    let mut rows = Vec::new();
    rows.extend(exact(letter).map(|phi| ("exact", phi)));
    if approach == Approach::Differential {
        for row in TABLES_4_5.iter().filter(|row| row.letter == letter) {
            rows.extend([("paper: DCCE", row.dcce), ("paper: DV", row.dv)]);
        }
    } else {
        rows.extend(TABLE_7.iter().filter(|row| row.0 == letter).map(|row| ("paper: estimated", row.1)));
    }
    rows.into_iter().map(|(name, values)| (name, values.map(Some))).collect()
}

/// True φ of the cyclopean camera, in mm and degrees per frame.
fn exact(letter: &str) -> Option<[f64; 6]> {
    Some(in_mm_deg(&two_frames(&lab_name(letter))?.phi_cyclopean(0)?))
}

/// Figures 11 to 14.
pub(super) fn figures(example: Option<Example<'_>>, results: &RealResults<'_>) -> Vec<Figure> {
    let along = |title, name: &str, letters: &[&str]| {
        let place = |letter: &&str| {
            let sequence = lab_name(letter);
            Some(SpeedPlace::of_sequence(speed(&sequence)?, sequence))
        };
        SpeedAxis { title, axis: Axis::log(name), places: letters.iter().filter_map(place).collect() }
    };
    let translating = along("translating, E to I", "|tZ| (mm per frame)", &TRANSLATING);
    let turning = along("turning, A to D", "|ΩY| (° per frame)", &TURNING);
    let title = |words: &str| format!("{words} (broken: the paper's values)");
    let about = "The room of the sequences lab-A to lab-M as the sensor gives it, and its computed disparity in steps of 1/16 px; \
                 blank where nothing can be matched.";
    let mut all: Vec<Figure> = example.map(|example| figures::images(example, about)).into_iter().collect();
    all.push(Figure {
        id: "figure-12".to_owned(),
        title: title("Figure 12. Error of VZ against speed"),
        caption: format!(
            "{} Broken lines with open marks: Tables 3 and 6 of the paper. {INPUT}",
            figures::VZ_CAPTION
        ),
        columns: 2,
        panels: figures::vz(results, [&translating, &turning], Some(&LabPaper)),
    });
    let motions = [
        ("figure-13", "Figure 13. Errors of φ against speed, translating", &translating, Quantity::Tz),
        ("figure-14", "Figure 14. Errors of φ against speed, turning", &turning, Quantity::Wy),
    ];
    for (id, words, axis, moving) in motions {
        let panels =
            |typical| figures::phi(results, axis, typical, |quantity| quantity == moving, Some(&LabPaper));
        let caption = |errors: &str| {
            format!(
                "{errors} {} Broken lines with open marks: Tables 4, 5 and 7 of the paper. {INPUT}",
                figures::PHI_CAPTION
            )
        };
        all.push(Figure {
            id: id.to_owned(),
            title: title(words),
            caption: caption("ERM where the true component is not zero, EAM where it is."),
            columns: 3,
            panels: panels(Typical::Mean),
        });
        all.push(Figure {
            id: format!("{id}-medians"),
            title: title(&format!("{words}, medians")),
            caption: caption("Medians over the draws, which single failures cannot ruin: in percent where the true component is not zero."),
            columns: 3,
            panels: panels(Typical::Median),
        });
    }
    all
}

/// The paper's values as lines.
struct LabPaper;

impl PaperLines for LabPaper {
    fn vz(&self, sequence: &str, contender: ImageContender) -> Option<f64> {
        let table = if contender.approach == Approach::Differential { &TABLE_3 } else { &TABLE_6 };
        let row = table.iter().find(|row| lab_name(row.letter) == sequence)?;
        Some(row.erm_percent[usize::from(contender.method == Method::Dv)].abs())
    }

    fn phi(&self, sequence: &str, contender: ImageContender, i: usize, relative: bool) -> Option<f64> {
        let of_table_7 = || TABLE_7.iter().find(|row| lab_name(row.0) == sequence);
        let of_tables_4_5 = || TABLES_4_5.iter().find(|row| lab_name(row.letter) == sequence);
        let (letter, values) = match contender.method {
            Method::Dcce => of_tables_4_5().map(|row| (row.letter, row.dcce))?,
            Method::Dv => of_tables_4_5().map(|row| (row.letter, row.dv))?,
            _ => *of_table_7()?,
        };
        let truth = exact(letter)?[i];
        let error = (values[i] - truth).abs();
        Some(if relative { 100.0 * error / truth.abs() } else { error })
    }
}
