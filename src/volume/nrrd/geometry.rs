//! Where the header says that the voxels are.

use glam::DVec3;

use super::fields::Fields;
use super::header::number;
use crate::volume::error::excerpt;
use crate::volume::grid::{check_direction, check_origin, check_spacing};
use crate::volume::{Grid, VolumeError};

/// Sizes, spacing, origin and directions of the three axes that span space.
pub(super) fn grid(fields: &Fields) -> Result<Grid, VolumeError> {
    let dimension: usize = number("dimension", fields.require("dimension")?)?;
    if !(3..=4).contains(&dimension) {
        let message = format!("{dimension} axes; expected 3, or 4 of which the first or last has size 1");
        return Err(VolumeError::unsupported("dimension", message));
    }
    let sizes = sizes(fields.require("sizes")?, dimension)?;
    let space = Space::read(fields)?;
    let directions = match fields.get("space directions") {
        Some(text) => vectors("space directions", text, dimension)?,
        None => vec![None; dimension],
    };
    let axes = spatial_axes(&sizes, &directions)?;
    check_kinds(fields, dimension, axes)?;

    let mut grid = Grid::axis_aligned(axes.map(|a| sizes[a]), DVec3::ONE);
    match axes.map(|a| directions[a]) {
        [Some(x), Some(y), Some(z)] => {
            let axes = [x, y, z].map(|d| d * space.lps_from_space);
            grid.spacing = DVec3::from_array(axes.map(DVec3::length));
            check_spacing("space directions", grid.spacing)?;
            grid.direction = axes.map(DVec3::normalize);
            check_direction("space directions", grid.direction)?;
        }
        [None, None, None] => {
            grid.spacing = spacings(fields, dimension, axes)?;
            check_spacing("spacings", grid.spacing)?;
            // The axes are those of the header's space.
            grid.direction = grid.direction.map(|d| d * space.lps_from_space);
        }
        _ => {
            return Err(VolumeError::malformed("space directions", "`none` for an axis that spans space"));
        }
    }
    if let Some(text) = fields.get("space origin") {
        let origin = vectors("space origin", text, 1)?[0].unwrap_or(DVec3::ZERO);
        // Adding 0 turns -0 into 0.
        grid.origin = origin * space.lps_from_space + DVec3::ZERO;
        check_origin("space origin", grid.origin)?;
    }
    Ok(grid)
}

/// The header's world space.
struct Space {
    /// Signs that turn its axes into left, posterior, superior.
    lps_from_space: DVec3,
}

impl Space {
    fn read(fields: &Fields) -> Result<Self, VolumeError> {
        if let Some(text) = fields.get("space dimension")
            && number::<u32>("space dimension", text)? != 3
        {
            let message = format!("{} is not supported; expected 3", excerpt(text));
            return Err(VolumeError::unsupported("space dimension", message));
        }
        let name = space_name(fields);
        let signs = match name.as_str() {
            "right-anterior-superior" | "ras" => [-1.0, -1.0, 1.0],
            "left-anterior-superior" | "las" => [1.0, -1.0, 1.0],
            "rast" | "last" | "lpst" => [0.0; 3],
            time if time.ends_with("-time") => [0.0; 3],
            _ => [1.0; 3],
        };
        if signs == [0.0; 3] {
            return Err(VolumeError::unsupported("space", format!("{} has four axes; expected three", excerpt(&name))));
        }
        Ok(Self { lps_from_space: DVec3::from_array(signs) })
    }
}

fn space_name(fields: &Fields) -> String {
    fields.get("space").unwrap_or_default().to_ascii_lowercase()
}

/// Whether the axes of the header's space are the patient's.
pub(super) fn is_patient_space(fields: &Fields) -> bool {
    let anatomical =
        ["right-anterior-superior", "ras", "left-anterior-superior", "las", "left-posterior-superior", "lps"];
    anatomical.contains(&space_name(fields).as_str())
}

fn sizes(text: &str, dimension: usize) -> Result<Vec<u32>, VolumeError> {
    words("sizes", text, dimension)?
        .into_iter()
        .map(|word| {
            let size: u64 = number("sizes", word)?;
            if size == 0 {
                return Err(VolumeError::malformed("sizes", "0 is not a size; expected at least 1"));
            }
            u32::try_from(size).map_err(|_| VolumeError::TooLarge {
                field: "sizes".to_owned(),
                unit: "voxels along an axis",
                needed: u128::from(size),
                limit: u64::from(u32::MAX),
            })
        })
        .collect()
}

/// Which of the file's axes are x, y and z: of four, the first or last is left out, the one without a direction first.
fn spatial_axes(sizes: &[u32], directions: &[Option<DVec3>]) -> Result<[usize; 3], VolumeError> {
    if sizes.len() == 3 {
        return Ok([0, 1, 2]);
    }
    let single = |axis: usize| sizes[axis] == 1;
    let without_direction = |axis: usize| directions[axis].is_none();
    if single(0) && without_direction(0) && !(single(3) && without_direction(3)) {
        Ok([1, 2, 3])
    } else if single(3) {
        Ok([0, 1, 2])
    } else if single(0) {
        Ok([1, 2, 3])
    } else {
        let message = format!("4 axes of sizes {sizes:?}; the first or the last must have size 1");
        Err(VolumeError::unsupported("dimension", message))
    }
}

/// Colours and vectors are not scalars, even if their components come as an axis of the file.
fn check_kinds(fields: &Fields, dimension: usize, axes: [usize; 3]) -> Result<(), VolumeError> {
    let Some(text) = fields.get("kinds") else {
        return Ok(());
    };
    let kinds = words("kinds", text, dimension)?;
    for kind in axes.map(|a| kinds[a]) {
        if !["domain", "space", "time", "list", "none", "???"].contains(&kind.to_ascii_lowercase().as_str()) {
            let message = format!("{} for an axis that spans space; expected domain or space", excerpt(kind));
            return Err(VolumeError::unsupported("kinds", message));
        }
    }
    Ok(())
}

fn spacings(fields: &Fields, dimension: usize, axes: [usize; 3]) -> Result<DVec3, VolumeError> {
    let Some(text) = fields.get("spacings") else {
        return Ok(DVec3::ONE);
    };
    let words = words("spacings", text, dimension)?;
    let mut spacing = [1.0; 3];
    for (length, axis) in spacing.iter_mut().zip(axes) {
        let value = float("spacings", words[axis])?;
        // NaN is the format's way to say that it is not known.
        if !value.is_nan() {
            *length = value;
        }
    }
    Ok(DVec3::from_array(spacing))
}

/// Exactly `expected` words.
fn words<'a>(field: &str, text: &'a str, expected: usize) -> Result<Vec<&'a str>, VolumeError> {
    let words: Vec<&str> = text.split_whitespace().take(expected + 1).collect();
    if words.len() == expected {
        Ok(words)
    } else {
        Err(VolumeError::malformed(field, format!("{} is not {expected} values, one per axis", excerpt(text))))
    }
}

/// Exactly `expected` vectors `(x,y,z)` or `none`.
fn vectors(field: &str, text: &str, expected: usize) -> Result<Vec<Option<DVec3>>, VolumeError> {
    let wrong = || VolumeError::malformed(field, format!("{} is not {expected} vectors (x,y,z)", excerpt(text)));
    let mut vectors = Vec::new();
    let mut rest = text.trim();
    while !rest.is_empty() && vectors.len() <= expected {
        if let Some(opened) = rest.strip_prefix('(') {
            let (inside, after) = opened.split_once(')').ok_or_else(wrong)?;
            let components: Vec<f64> =
                inside.split(',').take(4).map(|n| float(field, n.trim())).collect::<Result<_, _>>()?;
            let components: [f64; 3] = components.try_into().map_err(|_| wrong())?;
            vectors.push(Some(DVec3::from_array(components)));
            rest = after.trim_start();
        } else {
            let (word, after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
            if !word.eq_ignore_ascii_case("none") {
                return Err(wrong());
            }
            vectors.push(None);
            rest = after.trim_start();
        }
    }
    if vectors.len() == expected { Ok(vectors) } else { Err(wrong()) }
}

fn float(field: &str, text: &str) -> Result<f64, VolumeError> {
    text.parse().map_err(|_| VolumeError::malformed(field, format!("{} is not a number", excerpt(text))))
}
