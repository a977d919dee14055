//! Running studies: part by part, with progress, until done or stopped; then their files and one page.

use std::collections::BTreeSet;
use std::io::Write as _;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result, anyhow};
use egomotion_report::chart::number::count;
use egomotion_report::study::figure;
use egomotion_report::study::page::{self, Chapter};
use egomotion_study::Study;

use super::table;
use crate::exit::Ending;
use crate::journal::{Journal, JournalHeader, Parts, START_ANEW};
use crate::results::ResultFolder;
use crate::terminal::{self, parts_bar};

/// Where studies are run, one after another; their results share a folder and a page.
pub struct Laboratory {
    folder: ResultFolder,
    options: LaboratoryOptions,
    stop: Arc<AtomicBool>,
    chapters: Vec<Chapter>,
    /// Names of files that are taken, in lower case.
    names: BTreeSet<String>,
    interrupted: bool,
}

/// How studies are run.
#[derive(Debug, Clone, Default)]
pub struct LaboratoryOptions {
    /// Go on where an earlier run was stopped.
    pub resume: bool,
    /// Show no progress.
    pub quiet: bool,
    /// Headline of the page; that of the only study if there is none.
    pub title: Option<String>,
    /// The command that repeats the run.
    pub command: String,
}

/// What a study has found.
struct DoneParts<R> {
    /// Records of the parts that are done, in their order.
    records: Vec<R>,
    done: usize,
    /// Why it ended before all parts were done.
    failure: Option<anyhow::Error>,
}

impl Laboratory {
    /// A laboratory with this folder; it stops after the running part once `stop` is set.
    pub fn open(out: &Path, options: LaboratoryOptions, stop: Arc<AtomicBool>) -> Result<Self> {
        let folder = ResultFolder::create(out)?;
        // The page's name is taken.
        let names = BTreeSet::from([page::NAME.to_owned()]);
        Ok(Self { folder, options, stop, chapters: Vec::new(), names, interrupted: false })
    }

    /// Run a study and write what it finds, also when it is stopped or a part fails.
    pub fn run<S: Study>(&mut self, study: &S) -> Result<()> {
        if self.interrupted || self.stop.load(Ordering::Relaxed) {
            self.interrupted = true;
            return Ok(());
        }
        study.check().with_context(|| format!("study {}", study.name()))?;
        let parts = study.parts();
        let found = self.run_parts(study, &parts)?;
        self.interrupted = found.failure.is_none() && found.done < parts.len();
        self.publish(study, found.records, (found.done, parts.len()))?;
        found.failure.map_or(Ok(()), Err)
    }

    fn run_parts<S: Study>(&self, study: &S, parts: &[String]) -> Result<DoneParts<S::Record>> {
        let (mut journal, mut known) = self.journal(study, parts)?;
        let bar = parts_bar(parts.len(), known.len(), self.options.quiet);
        let mut found = DoneParts { records: Vec::new(), done: 0, failure: None };
        for (k, part) in parts.iter().enumerate() {
            if let Some(records) = known.remove(part) {
                found.records.extend(records);
                found.done += 1;
                continue;
            }
            // What is known of later parts is shown too.
            if found.failure.is_some() || self.stop.load(Ordering::Relaxed) {
                continue;
            }
            bar.set_message(format!("{}: {part}", study.name()));
            match study.run(k) {
                Ok(records) => {
                    // As they are read back, so that a resumed study differs in nothing.
                    found.records.extend(journal.exchange(part, &records)?);
                    found.done += 1;
                    bar.inc(1);
                }
                Err(error) => {
                    found.failure = Some(anyhow!(error).context(format!("study {}, {part}", study.name())));
                }
            }
        }
        bar.finish_and_clear();
        Ok(found)
    }

    fn journal<S: Study>(&self, study: &S, parts: &[String]) -> Result<(Journal, Parts<S::Record>)> {
        let path = self.folder.path().join(format!("{}.parts.jsonl", study.name()));
        let settings = serde_json::to_value(study).context("the settings cannot be put into JSON")?;
        let header = JournalHeader::new(format!("study {}", study.name()), settings);
        if !self.options.resume {
            return Ok((Journal::begin(&path, &header)?, Parts::new()));
        }
        let (journal, known) = Journal::resume(&path, &header)?;
        if let Some(name) = known.keys().find(|name| !parts.contains(name)) {
            return Err(anyhow!(
                "{}: holds the part {name}, which is not of this study any more; {START_ANEW}",
                path.display()
            ));
        }
        Ok((journal, known))
    }

    /// Write the files of a study, and the page anew.
    fn publish<S: Study>(
        &mut self,
        study: &S,
        records: Vec<S::Record>,
        (done, parts): (usize, usize),
    ) -> Result<()> {
        let publication = study.publish(&records);
        let settings = serde_json::to_string_pretty(study).context("the settings cannot be put into JSON")?;
        let mut chapter =
            Chapter { name: study.name(), publication, settings, done, parts, ..Chapter::default() };
        let all = chapter.publication.data.iter().chain(&chapter.publication.tables);
        for table in all {
            let name = self.name(study.name(), &table.id, "csv");
            self.folder.write(&name, &table::csv(table)?)?;
            chapter.tables.push(name);
        }
        for figure in &chapter.publication.figures {
            let name = self.name(study.name(), &figure.id, "svg");
            self.folder.write(&name, figure::svg(figure).as_bytes())?;
            chapter.figures.push(name);
        }
        self.chapters.push(chapter);
        let page = page::render(&self.chapters, self.options.title.as_deref(), &self.options.command);
        self.folder.write(page::NAME, page.as_bytes())
    }

    /// A name for a file that no other file of this laboratory has.
    fn name(&mut self, study: &str, id: &str, extension: &str) -> String {
        let plain = |c: char| if c.is_alphanumeric() || matches!(c, '-' | '_') { c } else { '-' };
        let stem: String = id.chars().map(plain).collect();
        let mut name = format!("{stem}.{extension}");
        let mut k = 1;
        while !self.names.insert(name.to_lowercase()) {
            let number = if k > 1 { format!("-{k}") } else { String::new() };
            name = format!("{study}-{stem}{number}.{extension}");
            k += 1;
        }
        name
    }

    /// Say what was written, and how it ended.
    pub fn close(self) -> Result<Ending> {
        let figures = self.chapters.iter().map(|chapter| chapter.figures.len()).sum();
        let tables = self.chapters.iter().map(|chapter| chapter.tables.len()).sum();
        if !self.chapters.is_empty() {
            writeln!(
                terminal::stdout(),
                "{}: {}, {}",
                self.folder.path().join(page::NAME).display(),
                count(figures, "figure", "figures"),
                count(tables, "table", "tables"),
            )?;
        }
        if !self.interrupted {
            return Ok(Ending::Done);
        }
        let (done, parts) = self.chapters.iter().fold((0, 0), |sum, c| (sum.0 + c.done, sum.1 + c.parts));
        terminal::tell(format_args!(
            "stopped after {done} of {parts} parts; the same command with --resume goes on"
        ));
        Ok(Ending::Interrupted)
    }
}
