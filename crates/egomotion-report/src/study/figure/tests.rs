//! Figures as files: XML that parses, coordinates that are finite, whatever the values.

use egomotion::geometry::{Field, Grid, Image};
use egomotion_study::{Axis, Content, Figure, Line, Panel, Point, Series};
use roxmltree::{Document, Node};

use super::svg;

fn point(x: f64, y: f64) -> Point {
    Point { x, y, standard_error: None }
}

fn series(name: &str, line: Line, points: Vec<Point>) -> Series {
    Series { name: name.into(), line, points }
}

fn plot(x: Axis, y: Axis, series: Vec<Series>) -> Panel {
    Panel { title: "(a) <panel>".into(), content: Content::Plot { x, y, series } }
}

fn figure(columns: usize, panels: Vec<Panel>) -> Figure {
    Figure {
        id: "f".into(),
        title: "Figure 1. <T> & \"t\"\u{0}".into(),
        caption: "C\u{b}".into(),
        columns,
        panels,
    }
}

/// Parses, and checks every number of every attribute that places something.
fn check(text: &str) -> Document<'_> {
    let document = Document::parse(text).unwrap_or_else(|e| panic!("{e}: {text}"));
    for node in document.descendants() {
        for attribute in node.attributes() {
            let value = attribute.value();
            let places = ["d", "x", "y", "width", "height", "transform", "points", "viewBox", "offset"];
            if !places.contains(&attribute.name()) {
                continue;
            }
            assert!(!value.contains("NaN") && !value.contains("inf"), "{}={value}", attribute.name());
            let numbers = value.split(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-')));
            for number in numbers.filter(|n| !n.is_empty() && *n != "-") {
                let number: f64 = number.parse().unwrap_or_else(|e| panic!("{value}: {e}"));
                assert!(number.abs() < 5000.0, "{}={value}", attribute.name());
            }
        }
    }
    document
}

fn texts<'a>(document: &'a Document<'_>) -> Vec<&'a str> {
    document.descendants().filter(|n| n.has_tag_name("text")).filter_map(|n| n.text()).collect()
}

const HOSTILE: [f64; 12] =
    [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, -1.0, 1e308, -1e308, 5e-324, 1e-300, 1.0, 1e18];

#[test]
fn hostile_values_leave_the_file_whole() {
    let axes = || {
        [
            Axis::linear("x\u{1} <&>"),
            Axis::log("y"),
            Axis::places("z", ["Inf.", "<16>", ""]),
            Axis::places("none", [""; 0]),
        ]
    };
    for x in axes() {
        for y in axes() {
            let all = HOSTILE
                .iter()
                .flat_map(|&x| HOSTILE.iter().map(move |&y| Point { x, y, standard_error: Some(x) }));
            let all: Vec<Point> = all.collect();
            let mut panels = vec![
                plot(x.clone(), y.clone(), vec![]),
                plot(x.clone(), y.clone(), vec![series("", Line::Solid, vec![])]),
                plot(x.clone(), y.clone(), vec![series("one", Line::Marks, vec![point(1.0, 1.0)])]),
                plot(
                    x.clone(),
                    y.clone(),
                    vec![series("inf", Line::Dashed, vec![point(1.0, f64::INFINITY)])],
                ),
            ];
            for line in [Line::Solid, Line::Dashed, Line::Marks, Line::Reference] {
                panels.push(plot(x.clone(), y.clone(), vec![series("all", line, all.clone())]));
            }
            for a in HOSTILE {
                for b in HOSTILE {
                    let two = vec![point(a, b), point(b, a), Point { x: 1.0, y: a, standard_error: Some(b) }];
                    panels.push(plot(x.clone(), y.clone(), vec![series("two", Line::Solid, two)]));
                }
            }
            check(&svg(&figure(12, panels)));
        }
    }
    check(&svg(&figure(0, vec![])));
}

#[test]
fn hostile_maps_leave_the_file_whole() {
    let field = |w: usize, h: usize| {
        Field::from_grid(Grid::from_fn(w, h, |u, v| HOSTILE[(u + w * v) % HOSTILE.len()] as f32))
    };
    let mut panels = Vec::new();
    for (w, h) in [(0, 0), (1, 1), (700, 3), (3, 700), (0, 5), (40, 30)] {
        for range in [(0.0, 1.0), (1.0, 1.0), (2.0, -2.0), (-1.0, 1.0), (f32::NAN, 1.0), (0.0, f32::INFINITY)]
        {
            let content = Content::Map { field: field(w, h), name: "VZ (mm)".into(), range };
            panels.push(Panel { title: String::new(), content });
        }
        let image = Image::from_fn(w, h, |u, v| HOSTILE[(u + v) % HOSTILE.len()] as f32);
        panels.push(Panel { title: "picture".into(), content: Content::Picture(image) });
    }
    check(&svg(&figure(7, panels)));
}

/// The ends of the drawn line, in the order of the points.
fn strokes<'a>(document: &'a Document<'_>, colour: &str) -> Vec<Node<'a, 'a>> {
    let of =
        |n: &Node<'_, '_>| n.attribute("stroke") == Some(colour) && n.attribute("stroke-linejoin").is_some();
    document.descendants().filter(of).collect()
}

#[test]
fn a_file_says_how_it_is_read() {
    let caption = "Noise of 1/8 px, least squares. ".repeat(20);
    let panels = vec![plot(Axis::linear("x"), Axis::linear("y"), vec![])];
    let text = svg(&Figure { caption: caption.clone(), ..figure(1, panels) });
    let document = check(&text);
    let said: Vec<&str> = texts(&document).into_iter().filter(|line| line.contains("squares")).collect();
    assert!(said.len() > 3 && said.iter().all(|line| line.len() < 90), "{said:?}");
    assert_eq!(said.join(" "), caption.trim());
    // Inside the picture.
    let tall: f64 = document.root_element().attribute("height").unwrap().parse().unwrap();
    let lines = document.descendants().filter(|n| n.text().is_some_and(|t| t.contains("squares")));
    let lowest = lines.filter_map(|n| n.attribute("y")?.parse::<f64>().ok()).fold(0.0, f64::max);
    assert!(lowest > 300.0 && lowest < tall, "{lowest} of {tall}");
}

#[test]
fn one_name_has_one_colour_in_every_panel() {
    let line = |name: &str| series(name, Line::Solid, vec![point(0.0, 1.0), point(1.0, 2.0)]);
    let panels = vec![
        plot(Axis::linear("x"), Axis::linear("y"), vec![line("dv"), line("dcce")]),
        plot(Axis::linear("x"), Axis::linear("y"), vec![line("dcce"), line("ml")]),
    ];
    let text = svg(&figure(2, panels));
    let document = check(&text);
    // A stroke in the legend and one in each panel.
    assert_eq!(["#0072b2", "#d55e00", "#009e73"].map(|c| strokes(&document, c).len()), [2, 3, 2]);
    let names = texts(&document);
    assert_eq!(["dv", "dcce", "ml"].map(|name| names.iter().filter(|n| **n == name).count()), [1; 3]);
}

#[test]
fn what_lies_far_outside_is_drawn_at_the_edge_and_told() {
    let mut points: Vec<Point> = (0..12).map(|k| point(f64::from(k), 1.0 + 0.1 * f64::from(k))).collect();
    let calm = svg(&figure(
        1,
        vec![plot(Axis::linear("x"), Axis::linear("y"), vec![series("a", Line::Solid, points.clone())])],
    ));
    assert!(!texts(&check(&calm)).contains(&"beyond the edge"));
    points[5].y = 1e6;
    let wild = svg(&figure(
        1,
        vec![plot(Axis::linear("x"), Axis::linear("y"), vec![series("a", Line::Solid, points)])],
    ));
    let document = check(&wild);
    assert!(texts(&document).contains(&"beyond the edge"));
    assert!(!texts(&document).iter().any(|text| text.contains("10⁶")), "the others are not pressed flat");
    let triangles = document.descendants().filter(|n| n.attribute("stroke") == Some("#fff"));
    assert_eq!(triangles.count(), 1);
}

#[test]
fn bars_are_two_standard_errors_long() {
    let bar = |y: f64, e: f64| Point { x: y, y, standard_error: Some(e) };
    let panels = vec![plot(
        Axis::linear("x"),
        Axis::linear("y"),
        vec![series("a", Line::Marks, vec![bar(4.0, 1.0), bar(0.0, 0.0), bar(8.0, f64::NAN)])],
    )];
    let text = svg(&figure(1, panels));
    let document = check(&text);
    assert!(texts(&document).contains(&"± 2 standard errors"));
    let d = document
        .descendants()
        .find(|n| n.attribute("stroke-width") == Some("1") && n.attribute("d").is_some());
    let d = d.and_then(|n| n.attribute("d")).unwrap();
    assert_eq!(d.matches('V').count(), 1, "only one of them has a bar: {d}");
    let (low, rest) = d.split_once('V').unwrap();
    let low: f64 = low.split(' ').nth(1).unwrap().parse().unwrap();
    let high: f64 = rest.split('M').next().unwrap().parse().unwrap();
    // The y axis starts at 0 and ends 6 % above 8: 8.48 over the height of the plot.
    let tall =
        document.descendants().find(|n| n.has_tag_name("clipPath")).and_then(|n| n.first_element_child());
    let tall: f64 = tall.and_then(|n| n.attribute("height")).unwrap().parse().unwrap();
    assert!(((low - high) - 4.0 / 8.48 * tall).abs() < 0.2, "{low} {high} {tall}");
}

#[test]
fn labels_of_an_axis_do_not_overlap() {
    let long: Vec<String> = (0..9).map(|k| format!("a rather long name {k}")).collect();
    let points: Vec<Point> = (0..9).map(|k| point(f64::from(k), 10f64.powi(3 * k - 20))).collect();
    let panel = plot(Axis::places("name", long), Axis::log("y"), vec![series("a", Line::Solid, points)]);
    let text = svg(&figure(1, vec![panel]));
    let document = check(&text);
    let ends: Vec<f64> = document
        .descendants()
        .filter(|n| {
            n.has_tag_name("text") && n.attribute("text-anchor") == Some("end") && n.attribute("y").is_some()
        })
        .map(|n| n.attribute("y").unwrap().parse().unwrap())
        .collect();
    assert!(ends.len() >= 3 && ends.windows(2).all(|w| w[0] - w[1] >= 11.0), "{ends:?}");
    let turned = document
        .descendants()
        .filter(|n| n.attribute("transform").is_some_and(|t| t.contains("rotate(-30)")));
    assert_eq!(turned.count(), 9, "every place keeps its name");
}
