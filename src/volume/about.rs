//! What a file says besides voxels and geometry, and what its reader has to say about it.

/// What is known of a volume besides its voxels. Not part of what it is: equal voxels from two files have equal sums.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct About {
    /// World axes are the patient's: x to the left, y to the back (posterior), z to the head (superior), in mm.
    pub patient_axes: bool,
    /// The file's own header, field by field in its order, as text.
    pub header: Vec<(String, String)>,
    /// What people should know: one sentence each, such as "2 slices are missing".
    pub notes: Vec<String>,
}
