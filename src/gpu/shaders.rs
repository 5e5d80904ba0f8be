//! Shader sources and the small language that puts them together.
//!
//! - `#import common/volume` puts a fragment in, once per shader.
//! - `#repeat L 0..=LEVELS` ... `#end` repeats lines with `@L@` replaced; `LEVELS` is given by the caller.
//!   Unrolled text instead of loops, because WGSL cannot index bindings.
//!
//! Every line remembers its file, so that an error names the place where it was written.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use thiserror::Error;

/// A `(name, text)` pair for each file under `shaders/`, without `.wgsl`.
macro_rules! sources {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../shaders/", $name, ".wgsl")))),*]
    };
}

const SOURCES: &[(&str, &str)] = sources![
    "common/accessibility",
    "common/levels",
    "common/marks",
    "common/shading",
    "common/spao_sampled",
    "common/spao_words",
    "common/tiles",
    "common/value_filtered",
    "common/value_texels",
    "ao_classify",
    "ao_collect",
    "ao_collect_bricks",
    "ao_mipmap_level",
    "ao_nbuffer_level",
    "ao_raytraced",
    "ao_spao",
    "ao_surface",
    "bench_plain_classify",
    "bench_plain_gather",
    "bench_plain_level",
    "gradient",
    "raycast",
];

/// WGSL ready for the driver, with the origin of every line.
#[derive(Clone, Debug)]
pub struct Assembled {
    /// The text.
    pub wgsl: String,
    /// `(file, line from 1)` of each line of `wgsl`.
    pub origins: Vec<(&'static str, u32)>,
}

/// Why a shader could not be put together.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{file}.wgsl:{line}: {message}")]
pub struct ShaderError {
    /// Where.
    pub file: String,
    /// Line, from 1.
    pub line: u32,
    /// What is wrong.
    pub message: String,
}

/// Names of all passes: the sources that are not fragments.
pub fn stems() -> impl Iterator<Item = &'static str> {
    SOURCES.iter().map(|s| s.0).filter(|name| !name.starts_with("common/"))
}

/// Puts the shader `stem` together. `values` gives numbers to the names in `#repeat` bounds, and
/// `replaced` maps an imported fragment to the one to use instead.
///
/// # Errors
/// [`ShaderError`] for unknown files, names and unbalanced blocks.
pub fn assemble(stem: &str, values: &[(&str, u32)], replaced: &[(&str, &str)]) -> Result<Assembled, ShaderError> {
    assemble_from(SOURCES, stem, values, replaced)
}

/// [`assemble`] from other `(name, text)` pairs than the program's own.
///
/// # Errors
/// As [`assemble`].
pub fn assemble_from(
    sources: &[(&'static str, &'static str)],
    stem: &str,
    values: &[(&str, u32)],
    replaced: &[(&str, &str)],
) -> Result<Assembled, ShaderError> {
    let mut assembler = Assembler {
        sources,
        values,
        replaced,
        seen: BTreeSet::new(),
        out: Assembled { wgsl: String::new(), origins: Vec::new() },
    };
    assembler.file(stem, stem, 0)?;
    Ok(assembler.out)
}

struct Assembler<'a> {
    sources: &'a [(&'static str, &'static str)],
    values: &'a [(&'a str, u32)],
    replaced: &'a [(&'a str, &'a str)],
    seen: BTreeSet<&'static str>,
    out: Assembled,
}

impl Assembler<'_> {
    fn file(&mut self, name: &str, importer: &str, line: u32) -> Result<(), ShaderError> {
        let name = self.replaced.iter().find(|r| r.0 == name).map_or(name, |r| r.1);
        let Some(&(name, text)) = self.sources.iter().find(|s| s.0 == name) else {
            return Err(error(importer, line, format!("no shader source `{name}`")));
        };
        if !self.seen.insert(name) {
            return Ok(());
        }
        let lines: Vec<(u32, &str)> = (1..).zip(text.lines()).collect();
        let mut rest = lines.as_slice();
        while let Some((&(number, line), after)) = rest.split_first() {
            rest = after;
            if let Some(import) = line.strip_prefix("#import ") {
                self.file(import.trim(), name, number)?;
            } else if let Some(head) = line.strip_prefix("#repeat ") {
                let end = rest.iter().position(|l| l.1.trim() == "#end");
                let end = end.ok_or_else(|| error(name, number, "`#repeat` without `#end`".into()))?;
                self.repeat(name, number, head, &rest[..end])?;
                rest = &rest[end + 1..];
            } else if line.starts_with('#') {
                return Err(error(name, number, format!("unknown directive `{line}`")));
            } else {
                self.push(name, number, line);
            }
        }
        Ok(())
    }

    fn repeat(&mut self, file: &'static str, number: u32, head: &str, body: &[(u32, &str)]) -> Result<(), ShaderError> {
        let bad = || error(file, number, format!("expected `#repeat NAME first..=last`, got `#repeat {head}`"));
        let (variable, range) = head.split_once(' ').ok_or_else(bad)?;
        let (first, last) = range.split_once("..=").ok_or_else(bad)?;
        let number_of = |text: &str| {
            let text = text.trim();
            let given = self.values.iter().find(|v| v.0 == text).map(|v| v.1);
            given.or_else(|| text.parse().ok()).ok_or_else(|| error(file, number, format!("`{text}` has no value")))
        };
        let (first, last) = (number_of(first)?, number_of(last)?);
        let (this, previous) = (format!("@{variable}@"), format!("@{variable}-1@"));
        for value in first..=last {
            for &(line, text) in body {
                let text = text.replace(&this, &value.to_string());
                let text = text.replace(&previous, &value.wrapping_sub(1).to_string());
                self.push(file, line, &text);
            }
        }
        Ok(())
    }

    fn push(&mut self, file: &'static str, line: u32, text: &str) {
        let _ = writeln!(self.out.wgsl, "{text}");
        self.out.origins.push((file, line));
    }
}

fn error(file: &str, line: u32, message: String) -> ShaderError {
    ShaderError { file: file.to_owned(), line, message }
}

impl Assembled {
    /// Parses the text.
    ///
    /// # Errors
    /// The first syntax error, at the place where its line was written.
    pub fn parse(&self) -> Result<naga::Module, ShaderError> {
        naga::front::wgsl::parse_str(&self.wgsl).map_err(|e| {
            let line = e.location(&self.wgsl).map_or(1, |l| l.line_number);
            let (file, line) = self.origins.get(line as usize - 1).copied().unwrap_or(("unknown", line));
            error(file, line, e.message().to_owned())
        })
    }
}
