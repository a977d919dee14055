//! Try.
use egomotion::study::{Cell, Study, real::*};
fn main() {
    let a: Vec<String> = std::env::args().skip(1).collect();
    let mut study = LabStudy::default();
    if !a.is_empty() {
        study.sequences = a;
    }
    let start = std::time::Instant::now();
    let mut all = Vec::new();
    for i in 0..study.parts().len() {
        all.extend(study.run(i).unwrap());
    }
    eprintln!("{:.1?}", start.elapsed());
    let publication = study.publish(&all);
    for t in publication.tables.iter().chain(&publication.data) {
        println!(
            "\n== {} {}\n{}",
            t.id,
            t.title,
            t.columns.iter().map(|c| c.heading.clone()).collect::<Vec<_>>().join(" | ")
        );
        for r in &t.rows {
            println!(
                "{}",
                r.iter()
                    .map(|c| match c {
                        Cell::Text(t) => t.clone(),
                        Cell::Number(n) => format!("{n:.4}"),
                        Cell::Count(n) => n.to_string(),
                        Cell::Empty => "–".into(),
                    })
                    .collect::<Vec<_>>()
                    .join(" | ")
            );
        }
    }
}
