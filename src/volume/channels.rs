//! Of a microscope's channels and time points, those that are shown.

use super::VolumeError;
use super::error::excerpt;

/// Channels that a note names.
const MOST_LISTED: usize = 20;

/// The channel that is chosen, or the first one, with a note that lists them.
///
/// # Errors
/// Names `channel` if there is no such.
pub(super) fn choose(
    chosen: Option<u32>,
    channels: usize,
    names: &[Option<String>],
    notes: &mut Vec<String>,
) -> Result<usize, VolumeError> {
    let name = |c: usize| match names.get(c) {
        Some(Some(name)) => format!("channel={c} ({})", excerpt(name)),
        _ => format!("channel={c}"),
    };
    let listed: Vec<String> = (0..channels.min(MOST_LISTED)).map(name).collect();
    let more = if channels > MOST_LISTED { ", ..." } else { "" };
    let list = format!("{}{more}", listed.join(", "));
    match chosen {
        Some(chosen) if chosen as usize >= channels => {
            let message = format!("{chosen} is not a channel of this file; it has {list}");
            Err(VolumeError::malformed("channel", message))
        }
        Some(chosen) => Ok(chosen as usize),
        None => {
            if channels > 1 {
                notes.push(format!("Of {channels} channels the first is shown: {list}."));
            }
            Ok(0)
        }
    }
}

/// Says so where only the first of several time points is shown.
pub(super) fn note_frames(frames: usize, notes: &mut Vec<String>) {
    if frames > 1 {
        notes.push(format!("Of {frames} time points the first is shown."));
    }
}
