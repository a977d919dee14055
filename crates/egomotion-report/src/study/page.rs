//! `page.html`: what studies show, as one self-contained page.

use egomotion_study::{Figure, Publication, Table};
use maud::{Markup, html};

use super::figure::Drawing;
use super::table;
use crate::chart::document::document;
use crate::chart::number::count;

/// Its name in the folder of results.
pub const NAME: &str = "page.html";
/// Rules for the parts of this page.
const STYLE: &str = include_str!("style.css");

/// One study of a page, with the names of its files.
#[derive(Default)]
pub struct Chapter {
    /// Name of the study.
    pub name: &'static str,
    /// Its tables and figures.
    pub publication: Publication,
    /// Files of the data, then of the tables.
    pub tables: Vec<String>,
    /// Files of the figures.
    pub figures: Vec<String>,
    /// Settings as JSON.
    pub settings: String,
    /// Number of parts that are done.
    pub done: usize,
    /// Number of parts.
    pub parts: usize,
}

impl Chapter {
    fn data(&self) -> impl Iterator<Item = (&Table, &String)> {
        self.publication.data.iter().zip(&self.tables)
    }

    fn shown_tables(&self) -> impl Iterator<Item = (&Table, &String)> {
        self.publication.tables.iter().zip(self.tables.iter().skip(self.publication.data.len()))
    }

    fn shown_figures(&self) -> impl Iterator<Item = (&Figure, &String)> {
        self.publication.figures.iter().zip(&self.figures)
    }
}

/// The whole page as one HTML document that loads nothing.
///
/// `title` is the headline; that of the only study if there is none. `command` repeats the run.
pub fn render(chapters: &[Chapter], title: Option<&str>, command: &str) -> String {
    let only = chapters.first().map_or("", |chapter| chapter.publication.title.as_str());
    let title = title.unwrap_or(only);
    let body = html! {
        header { h1 { (title) } }
        main {
            (notes(chapters))
            (contents(chapters))
            @for chapter in chapters { (body(chapter, chapters.len() > 1)) }
            (repeat(chapters, command))
        }
        footer { "Made by egomotion " (env!("CARGO_PKG_VERSION")) ". Figures and tables are in files beside this page." }
    };
    document(title, STYLE, &body)
}

/// What is not done.
fn notes(chapters: &[Chapter]) -> Markup {
    let open: Vec<&Chapter> = chapters.iter().filter(|chapter| chapter.done < chapter.parts).collect();
    html! {
        @if !open.is_empty() {
            ul class="notes" {
                @for chapter in open {
                    li { b { (chapter.name) } ": " (chapter.done) " of " (count(chapter.parts, "part is", "parts are")) " done. The same command with --resume does the rest." }
                }
            }
        }
    }
}

fn contents(chapters: &[Chapter]) -> Markup {
    html! {
        nav aria-label="contents" {
            section {
                h2 { "Contents" }
                @for chapter in chapters {
                    @if chapters.len() > 1 { h3 { a href=(format!("#{}", chapter.name)) { (chapter.publication.title) } } }
                    ul class="contents" {
                        @for (figure, file) in chapter.shown_figures() { li { a href=(format!("#{file}")) { (figure.title) } } }
                        @for (table, file) in chapter.shown_tables() { li { a href=(format!("#{file}")) { (table.title) } } }
                        @if !chapter.publication.data.is_empty() { li { a href=(format!("#{}-data", chapter.name)) { "Full results" } } }
                    }
                }
            }
        }
    }
}

fn body(chapter: &Chapter, headed: bool) -> Markup {
    html! {
        @if headed { h2 class="chapter" id=(chapter.name) { (chapter.publication.title) } }
        @for (figure, file) in chapter.shown_figures() { (one_figure(figure, file)) }
        @for (table, file) in chapter.shown_tables() {
            section id=(file) {
                h2 { (table.title) }
                @if !table.caption.is_empty() { p { (table.caption) } }
                (table::html(table))
                p class="small" { a href=(file) { (file) } }
            }
        }
        @if !chapter.publication.data.is_empty() {
            section id=(format!("{}-data", chapter.name)) {
                h2 { "Full results" }
                ul class="files" {
                    @for (table, file) in chapter.data() {
                        li { a href=(file) { (file) } ": " (table.title) ", " (count(table.rows.len(), "row", "rows")) ". " (table.caption) }
                    }
                }
            }
        }
    }
}

fn one_figure(figure: &Figure, file: &str) -> Markup {
    let drawing = Drawing::new(figure, file.trim_end_matches(".svg"));
    html! {
        section id=(file) {
            figure class="drawn" {
                h2 { (figure.title) }
                div class="paper" {
                    @if !drawing.legend.is_empty() {
                        ul class="keys" {
                            @for (sample, name) in &drawing.legend { li { svg viewBox="0 0 30 12" aria-hidden="true" { (sample) } (name) } }
                        }
                    }
                    div class="grid" style=(format!("--columns:{}", drawing.columns)) {
                        (drawing.apart())
                    }
                }
                figcaption { (figure.caption) }
            }
            p class="small" { a href=(file) { (file) } }
        }
    }
}

fn repeat(chapters: &[Chapter], command: &str) -> Markup {
    html! {
        section {
            h2 { "Once more" }
            p { "The command that makes this page again, and all that was set." }
            pre { code { (command) } }
            @for chapter in chapters {
                details { summary { "Settings of " (chapter.name) } pre { code { (chapter.settings) } } }
            }
        }
    }
}
