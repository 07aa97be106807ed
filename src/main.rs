//! The program `beadline`.

fn main() -> std::process::ExitCode {
    beadline::main_with(&[])
}
