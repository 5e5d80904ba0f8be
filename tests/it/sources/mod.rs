//! Volumes from elsewhere: what may be fetched, over HTTP and from an object store.

mod addresses;
mod allowed;
mod elsewhere;
mod http;
mod s3;
