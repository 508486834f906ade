//! Pipes, quiet and interruption.

use std::io::Read;
use std::process::Stdio;

use crate::harness::Cli;

#[test]
fn a_closed_pipe_is_no_error() {
    let cli = Cli::new();
    cli.ok(&["fit", "lambert", "--lattice", "4x4x4", "-o", "m.safetensors"]);
    let rows = "10,20,30\n".repeat(20_000);
    cli.write("d.csv", format!("theta_h,theta_d,phi_d\n{rows}"));
    for arguments in
        [&["materials"][..], &["predict", "m.safetensors", "d.csv"], &["info", "lambert", "--json"]]
    {
        let mut child = cli.command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        // The predictions fill any pipe, so that the program meets the closed end.
        let mut first = [0];
        let mut stdout = child.stdout.take().unwrap();
        if arguments[0] == "predict" {
            stdout.read_exact(&mut first).unwrap();
        }
        drop(stdout);
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {output:?}");
        assert!(output.stderr.is_empty(), "{arguments:?}: {output:?}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error() {
    let cli = Cli::new();
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output = cli.command(&["materials"]).stdout(full).stderr(Stdio::piped()).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(
        String::from_utf8(output.stderr).unwrap(),
        "error: cannot write to standard output: No space left on device (os error 28)\n"
    );
}

#[test]
fn quiet_says_nothing() {
    let cli = Cli::new();
    cli.write("d.csv", "theta_h,theta_d,phi_d\n1,2,3\n");
    for arguments in [
        &["fit", "phong", "--lattice", "6x4x4", "-o", "m.safetensors"][..],
        &["predict", "m.safetensors", "d.csv", "-o", "p.csv"],
        &["slice", "phong", "-o", "s.png", "--size", "16"],
        &["convert", "phong", "c.csv", "--samples", "50"],
        &["eval", "phong", "lambert"],
        &["bake", "phong", "--lattice", "6x4x4", "-o", "out", "--no-images", "--no-metrics"],
    ] {
        assert_eq!(cli.ok(&[arguments, &["--quiet"]].concat()), "", "{arguments:?}");
        assert_eq!(cli.ok(&[&["-q"], arguments].concat()), "", "{arguments:?}");
    }
    // Errors and what was asked for remain.
    assert!(!cli.ok(&["-q", "predict", "m.safetensors", "d.csv"]).is_empty());
    assert!(!cli.ok(&["-q", "materials"]).is_empty());
    assert!(!cli.fails(&["-q", "info", "absent"]).is_empty());
    let verbose = cli.run(&["-v", "fit", "phong", "--lattice", "6x4x4", "-o", "m.safetensors"]);
    assert!(verbose.stderr.contains("symmetry"), "{verbose:?}");
}

#[cfg(unix)]
#[test]
fn an_interruption_leaves_no_file() {
    use std::process::Command;
    use std::time::{Duration, Instant};
    let cli = Cli::new();
    std::fs::create_dir(cli.path("out")).unwrap();
    for (command, delay) in [("bake", 300), ("fit", 700)] {
        let output = if command == "bake" { "out" } else { "out/m.safetensors" };
        // Minutes of work, if nobody stops it.
        let arguments = [command, "phong", "--layout", "random", "--samples", "4000", "-q", "-o", output];
        let mut child =
            cli.command(&arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(delay));
        assert!(child.try_wait().unwrap().is_none(), "{command} ended by itself");
        let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        assert!(sent.success());
        let begin = Instant::now();
        let output = child.wait_with_output().unwrap();
        assert!(begin.elapsed() < Duration::from_secs(5), "{command} took {:?} to stop", begin.elapsed());
        assert_eq!(output.status.code(), Some(130), "{command}: {output:?}");
        assert_eq!(cli.names("out"), [""; 0], "{command}");
    }
}
