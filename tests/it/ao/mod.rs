//! Accessibility: plans and keys, and the GPU against its twin.
