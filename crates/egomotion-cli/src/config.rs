//! `egomotion config`: every default with its meaning, as TOML that `run --config` takes back.

use std::io::Write as _;

use anyhow::{Context, Result};
use clap::ValueEnum;
use egomotion::pipeline::{Config, meaning};
use toml::{Table, Value};

use crate::args::{ApproachArg, EstimatorArg, MethodArg, ObserveArg};
use crate::exit::Ending;
use crate::terminal;

/// Characters of the longest line of a comment; longer ones leave the window of a usual editor.
const COMMENT_WIDTH: usize = 96;

/// Print the defaults.
pub fn config() -> Result<Ending> {
    let table = Table::try_from(Config::default()).context("cannot put the settings into TOML")?;
    let mut text = String::from(
        "# Settings of `egomotion run --config FILE`: every default, with its meaning.\n\
         # What is left out keeps its default; options of the command line come before the file.\n\n",
    );
    section(&mut text, &table, &[]);
    terminal::stdout().write_all(text.as_bytes())?;
    Ok(Ending::Done)
}

/// The settings of one table, then the tables in it.
fn section(text: &mut String, table: &Table, path: &[&str]) {
    let (tables, settings): (Vec<_>, Vec<_>) = table.iter().partition(|(_, value)| value.is_table());
    for (name, value) in settings {
        comment(text, &[path, &[name]].concat());
        for choice in choices(name).filter(|_| path.is_empty()) {
            text.push_str(&format!("#   {choice}\n"));
        }
        text.push_str(&format!("{name} = {}\n\n", shortest(value)));
    }
    for (name, value) in tables {
        let path = [path, &[name.as_str()]].concat();
        comment(text, &path);
        text.push_str(&format!("[{}]\n\n", path.join(".")));
        if let Value::Table(inner) = value {
            section(text, inner, &path);
        }
    }
    while text.ends_with("\n\n\n") {
        text.pop();
    }
}

/// The first paragraph of a setting's meaning.
fn comment(text: &mut String, path: &[&str]) {
    let Some(meaning) = meaning(path) else { return };
    let mut line = String::from("#");
    for word in meaning.split("\n\n").next().unwrap_or_default().split_whitespace() {
        let word = without_links(word);
        if line.chars().count() + word.chars().count() >= COMMENT_WIDTH {
            text.push_str(&line);
            text.push('\n');
            line = String::from("#");
        }
        line.push(' ');
        line.push_str(&word);
    }
    text.push_str(&line);
    text.push('\n');
}

/// A word of a documentation comment without its marks; of a path in the sources its last name.
fn without_links(word: &str) -> String {
    let plain = word.replace("[`", "").replace("`]", "").replace('`', "");
    match plain.split_once("crate::") {
        Some((before, path)) => format!("{before}{}", path.rsplit("::").next().unwrap_or(path)),
        None => plain,
    }
}

/// What a word may be, and what each means.
fn choices(name: &str) -> impl Iterator<Item = String> {
    fn of<T: ValueEnum>() -> Vec<String> {
        let line = |choice: &T| {
            let value = choice.to_possible_value()?;
            let help = value.get_help().map(ToString::to_string).unwrap_or_default();
            Some(format!("{}: {help}", value.get_name()))
        };
        T::value_variants().iter().filter_map(line).collect()
    }
    let lines = match name {
        "method" => of::<MethodArg>(),
        "approach" => of::<ApproachArg>(),
        "estimator" => of::<EstimatorArg>(),
        "observe" => of::<ObserveArg>(),
        _ => Vec::new(),
    };
    lines.into_iter()
}

/// A number of single precision has the digits that tell it from its neighbours, no more.
fn shortest(value: &Value) -> String {
    match value {
        Value::Float(v) if v.is_finite() && f64::from(*v as f32) == *v => format!("{:?}", *v as f32),
        other => other.to_string(),
    }
}
