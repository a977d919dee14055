//! What every page is: one HTML document that loads nothing.

use maud::{DOCTYPE, Markup, PreEscaped, html};

/// The look that all pages share; each page adds rules for its own parts.
const STYLE: &str = include_str!("page.css");
/// Nothing is loaded from anywhere, whatever the texts of the input say.
const POLICY: &str = "default-src 'none'; img-src data:; style-src 'unsafe-inline'";

/// A page of this title and body; `style` has the rules for its own parts.
pub(crate) fn document(title: &str, style: &str, body: &Markup) -> String {
    page(title, style, POLICY, body)
}

/// The same, whose body may hold scripts.
pub(crate) fn scripted_document(title: &str, style: &str, body: &Markup) -> String {
    page(title, style, &format!("{POLICY}; script-src 'unsafe-inline'"), body)
}

fn page(title: &str, style: &str, policy: &str, body: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta http-equiv="Content-Security-Policy" content=(policy);
                title { (title) }
                style { (PreEscaped(STYLE)) (PreEscaped(style)) }
            }
            body { (body) }
        }
    };
    page.into_string()
}
