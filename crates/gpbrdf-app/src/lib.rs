//! The programs of gpbrdf as a library: the binaries only call [`cli::main`] and `viewer::main`.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::float_cmp, reason = "tests state exact expectations"))]
#![expect(clippy::doc_markdown, reason = "descriptions of arguments are shown to people as they are")]

pub mod cli;
mod job;
mod message;
mod output;
mod reproduce;
#[cfg(feature = "viewer")]
pub mod viewer;

/// The examples of the README, which are tests of documentation.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
