//! `report.html` of a set: its scenes, each with a link to its own page.

use maud::html;

use super::page::STYLE;
use crate::chart::document::document;

/// One scene of a set.
#[derive(Debug, Clone)]
pub struct SceneSummary {
    /// Its name, which is its folder's too.
    pub name: String,
    /// Number of frames.
    pub frames: usize,
    /// What came out, in a few words.
    pub outcome: String,
    /// What the maps are worth against truth, if there is one.
    pub verdict: String,
    /// Whether it has a page.
    pub has_page: bool,
}

/// The index as one HTML document that loads nothing.
pub fn render(source: &str, command: &str, complete: bool, scenes: &[SceneSummary]) -> String {
    let body = html! {
        header {
            p class="kicker" { "egomotion · a set of scenes" }
            h1 { (source) }
            p class="lede" { "Each scene stands by itself, with a page of its own." }
            @if !complete { p class="about" { "The run was stopped before its end: only the scenes below were done." } }
        }
        main {
            section {
                div class="scroll" {
                    table class="scenes" {
                        thead { tr { th { "scene" } th { "frames" } th { "motion" } th { "against the set's true maps" } } }
                        tbody {
                            @for scene in scenes {
                                tr {
                                    td {
                                        @if scene.has_page { a href=(format!("{}/report.html", scene.name)) { (scene.name) } }
                                        @else { (scene.name) }
                                    }
                                    td { (scene.frames) }
                                    td { (scene.outcome) }
                                    td { (scene.verdict) }
                                }
                            }
                        }
                    }
                }
            }
            section { h2 { "Once more" } pre { code { (command) } } }
        }
        footer { "Made by egomotion " (env!("CARGO_PKG_VERSION")) "." }
    };
    document(source, STYLE, &body)
}
