//! Which files belong together, and which of the series is meant.

use std::collections::BTreeMap;

use super::image::Slice;
use crate::volume::VolumeError;
use crate::volume::error::excerpt;

/// A series with so few slices is a localizer: it is passed over beside one that is a volume.
const LOCALIZER_SLICES: usize = 2;

/// Series that a message lists.
const MOST_LISTED: usize = 20;

/// Files with the same `SeriesInstanceUID`.
#[derive(Debug, Default)]
pub(super) struct Series {
    pub(super) number: Option<String>,
    pub(super) modality: Option<String>,
    pub(super) description: Option<String>,
    pub(super) slices: Vec<Slice>,
    /// What to tell about its values.
    pub(super) remarks: Vec<&'static str>,
    /// Why a file of it cannot be read.
    pub(super) refusal: Option<VolumeError>,
    /// Pictures, also those that cannot be read.
    pub(super) pictures: usize,
}

/// By `SeriesInstanceUID`.
pub(super) type AllSeries = BTreeMap<String, Series>;

/// Takes the series that is meant out of all. `choice` is its number, its `SeriesInstanceUID` or the end of that.
///
/// Without a choice it is the only one that is readable and more than a localizer; the others are noted.
///
/// # Errors
/// Names `series`, with a list of them, if none or several are meant; that of a file if the one that is meant has a
/// file that cannot be read.
pub(super) fn choose(mut all: AllSeries, choice: Option<&str>, notes: &mut Vec<String>) -> Result<Series, VolumeError> {
    let meant: Vec<String> = match choice {
        Some(choice) => matching(&all, choice),
        None => candidates(&all),
    };
    let [uid] = meant.as_slice() else {
        let reason = match choice {
            Some(choice) if meant.is_empty() => format!("{} is none of the series here", excerpt(choice)),
            Some(choice) => format!("{} is more than one of the series here", excerpt(choice)),
            None => format!("{} series are here; choose one", all.len()),
        };
        return Err(VolumeError::malformed("series", format!("{reason}: {}", list(&all, true))));
    };
    let Some(mut chosen) = all.remove(uid) else {
        return Err(VolumeError::malformed("series", "none"));
    };
    if let Some(refusal) = chosen.refusal.take() {
        return Err(refusal);
    }
    if choice.is_none() && !all.is_empty() {
        notes.push(format!("Other series were passed over: {}.", list(&all, false)));
    }
    Ok(chosen)
}

fn matching(all: &AllSeries, choice: &str) -> Vec<String> {
    let uids = |is: &dyn Fn(&str, &Series) -> bool| -> Vec<String> {
        all.iter().filter(|(uid, series)| is(uid, series)).map(|(uid, _)| uid.clone()).collect()
    };
    let by_number = uids(&|uid, series| uid == choice || series.number.as_deref() == Some(choice));
    if by_number.is_empty() && !choice.is_empty() { uids(&|uid, _| uid.ends_with(choice)) } else { by_number }
}

fn candidates(all: &AllSeries) -> Vec<String> {
    let uids = |is: &dyn Fn(&Series) -> bool| -> Vec<String> {
        all.iter().filter(|(_, series)| is(series)).map(|(uid, _)| uid.clone()).collect()
    };
    let volumes = uids(&|series| series.refusal.is_none() && series.slices.len() > LOCALIZER_SLICES);
    if !volumes.is_empty() {
        return volumes;
    }
    let readable = uids(&|series| series.refusal.is_none());
    // If nothing can be read, the first says why.
    if readable.is_empty() { all.keys().take(1).cloned().collect() } else { readable }
}

/// `series=3 (CT "Thorax", 120 slices), series=...`. Descriptions are what somebody has typed, and may name a patient:
/// they are for whoever has sent the file, and not for notes that stay.
fn list(all: &AllSeries, with_descriptions: bool) -> String {
    let one = |(uid, series): (&String, &Series)| {
        let alone = |number: &&String| all.values().filter(|s| s.number.as_ref() == Some(*number)).count() == 1;
        let name = series.number.as_ref().filter(alone).map_or_else(|| short(all, uid), String::as_str);
        let modality = series.modality.as_deref().unwrap_or("no modality");
        let description = series.description.as_deref().filter(|_| with_descriptions);
        let description = description.map(|text| format!(" {}", excerpt(text))).unwrap_or_default();
        let unreadable = if series.refusal.is_some() { ", not readable" } else { "" };
        let plural = if series.pictures == 1 { "" } else { "s" };
        format!(
            "series={} ({}{description}, {} slice{plural}{unreadable})",
            excerpt(name).trim_matches('`'),
            excerpt(modality).trim_matches('`'),
            series.pictures
        )
    };
    let mut listed: Vec<String> = all.iter().take(MOST_LISTED).map(one).collect();
    if all.len() > MOST_LISTED {
        listed.push(format!("and {} more", all.len() - MOST_LISTED));
    }
    listed.join(", ")
}

/// As many of the last numbers of a unique identifier as tell it from the others, and from their series' numbers.
fn short<'u>(all: &AllSeries, uid: &'u str) -> &'u str {
    let ends = uid.rmatch_indices('.').map(|(dot, _)| &uid[dot + 1..]);
    let is_number = |end: &str| all.values().any(|series| series.number.as_deref() == Some(end));
    let is_one = |end: &&str| all.keys().filter(|other| other.ends_with(end)).count() == 1;
    ends.filter(|end| !end.is_empty() && !is_number(end)).find(is_one).unwrap_or(uid)
}
