//! A graphics device for tests.

use std::io::Write as _;
use std::sync::OnceLock;

use gpbrdf_render::{AdapterChoice, Context};

/// Runs a test on a device, which all tests of a process share. Without an adapter the test is skipped, which
/// is said on standard error.
///
/// # Panics
/// Without an adapter if the environment variable `GPBRDF_REQUIRE_GPU` is 1, and where `test` does.
pub(crate) fn on_device(name: &str, test: fn(&Context)) {
    static CONTEXT: OnceLock<Result<Context, String>> = OnceLock::new();
    match CONTEXT.get_or_init(|| Context::open(AdapterChoice::Any).map_err(|error| error.to_string())) {
        Ok(context) => test(context),
        Err(error) => {
            let required = std::env::var("GPBRDF_REQUIRE_GPU").is_ok_and(|value| value == "1");
            assert!(!required, "{error}");
            // Not by `eprintln!`, which is captured.
            let _ = std::io::stderr().write_all(format!("skipped {name}: {error}\n").as_bytes());
        }
    }
}

/// Declares functions of a context as tests that run by [`on_device`]. A function that is not listed is
/// unused, which the compiler says.
#[allow(unused_macros, reason = "a test program with one test declares it by itself")]
macro_rules! gpu_tests {
    ($($name:ident),+ $(,)?) => {
        mod gpu {
            $(
                #[test]
                fn $name() {
                    $crate::support::on_device(stringify!($name), super::$name);
                }
            )+
        }
    };
}
#[allow(unused_imports, reason = "as above")]
pub(crate) use gpu_tests;
