//! The command line from outside: the built program on real arguments, its files, messages and exit codes.
#![allow(clippy::unwrap_used, reason = "a test that finds nothing to unwrap has failed")]

mod harness;

mod cli {
    mod bake;
    mod batch;
    mod broken_files;
    mod check;
    mod commands;
    mod dense;
    mod device;
    mod faults;
    mod inducing;
    mod instruments;
    mod kills;
    mod measured;
    mod odd_input;
    mod plan;
    mod process;
    mod render;
    mod reproduce;
    mod sample;
    mod usage;
}
