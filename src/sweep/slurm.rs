//! A sweep as a job array of Slurm: its script, and sbatch.
//!
//! - `slurm/array.sh` the script, a shard for each task
//! - `slurm/I-of-N.out` what the tasks of a shard have said
//! - `slurm/I-of-N.trace` when they began and ended, for [`super::status`]

use super::directory::Directory;
use crate::args::SlurmArgs;
use crate::child::this_program;
use crate::failure::Failure;
use anyhow::{Context, anyhow};
use producer::sweep::Sweep;
use schemas::whole_file::{self, create_directory};
use serde::Serialize;
use std::fs;
use std::io;
use std::iter;
use std::path::Path;
use std::process::Command;

/// Rest of the script after the options of sbatch, which [`script`] makes.
const TASK: &str = include_str!("slurm/task.sh");

/// Slurm's own default for the largest array is 1001, its `MaxArraySize`.
const DEFAULT_ARRAY_SIZE: u64 = 1000;

/// Directory of the job array in the directory of a sweep.
pub(super) const SLURM: &str = "slurm";
pub(super) const SCRIPT: &str = "array.sh";

/// A job array that was written, and perhaps sent.
#[derive(Debug, Serialize)]
pub(crate) struct JobArray {
    pub(crate) script: String,
    pub(crate) array_size: u64,
    /// Its number, if it was sent.
    pub(crate) job: Option<String>,
}

/// Writes the script of a job array that computes `sweep` in the directory `out`, and sends it if that is asked for.
///
/// # Errors
/// When the directory belongs to something else, when another script is there and not to be replaced, or when sbatch
/// refuses.
pub(crate) fn job_array(
    sweep: &Sweep,
    out: &Path,
    args: &SlurmArgs,
    (record, force): (bool, bool),
) -> Result<JobArray, Failure> {
    // rows are kept whatever the script becomes
    Directory::open(out, sweep, false)?;
    let out = fs::canonicalize(out).with_context(|| out.display().to_string())?;
    let array_size = args.array_size.map_or(DEFAULT_ARRAY_SIZE, Into::into).min(sweep.point_count().max(1));
    let text = script(sweep.path(), &out, args, array_size, record)?;
    let path = out.join(SLURM).join(SCRIPT);
    create_directory(&out.join(SLURM))?;
    match fs::read_to_string(&path) {
        Ok(found) if found == text => {}
        Ok(_) if !force => {
            return Err(bad_input!(
                "{} was written with other options; replace it with --force, which keeps the rows",
                path.display()
            ));
        }
        _ => whole_file::write(&path, text.as_bytes(), true)?,
    }
    let job = args.submit.then(|| submit(&path)).transpose()?;
    Ok(JobArray { script: path.display().to_string(), array_size, job })
}

fn script(
    sweep: &Path,
    out: &Path,
    args: &SlurmArgs,
    array_size: u64,
    record: bool,
) -> Result<String, Failure> {
    let command = this_program()?;
    let words = iter::once(command.get_program()).chain(command.get_args());
    let words =
        words.map(|word| Ok(shell_word(text_of(Path::new(word))?))).collect::<Result<Vec<_>, Failure>>()?;
    let sweep = fs::canonicalize(sweep).with_context(|| sweep.display().to_string())?;
    let name = out.file_name().unwrap_or_default().to_string_lossy();
    let mut options = vec![
        directive("job-name", &format!("beadline-{name}"))?,
        directive("chdir", text_of(out)?)?,
        directive("array", &format!("0-{}", array_size - 1))?,
        directive("cpus-per-task", &args.cpus.to_string())?,
    ];
    let given = [
        ("time", args.time.as_ref().map(|time| time.text.as_str())),
        ("mem", args.mem.as_deref()),
        ("partition", args.partition.as_deref()),
        ("account", args.account.as_deref()),
    ];
    for (name, value) in given {
        options.extend(value.map(|value| directive(name, value)).transpose()?);
    }
    options.extend(args.sbatch.iter().map(|line| format!("#SBATCH {line}")));
    Ok(TASK
        .replace("@OPTIONS@", &options.join("\n"))
        .replace("@ARRAY_SIZE@", &array_size.to_string())
        .replace("@RECORD@", if record { " --record" } else { "" })
        .replace("@PROGRAM@", &words.join(" "))
        .replace("@SWEEP@", &shell_word(text_of(&sweep)?)))
}

/// An option as a script has it for sbatch, which knows double quotes only.
fn directive(name: &str, value: &str) -> Result<String, Failure> {
    if value.contains(['"', '\\', '\n']) {
        return Err(bad_input!(
            "{name}: found {value:?}; sbatch takes none with quotes, \\ or a line's end in it"
        ));
    }
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_./:,=@%+".contains(&byte);
    let quote = if value.bytes().all(is_plain) { "" } else { "\"" };
    Ok(format!("#SBATCH --{name}={quote}{value}{quote}"))
}

/// `text` as one word of a shell.
fn shell_word(text: &str) -> String {
    format!("'{}'", text.replace('\'', r"'\''"))
}

fn text_of(path: &Path) -> Result<&str, Failure> {
    path.to_str().ok_or_else(|| bad_input!("{} is no UTF-8; a script cannot name it", path.display()))
}

/// Sends the script, and gives the number of the job.
fn submit(script: &Path) -> Result<String, Failure> {
    let output = Command::new("sbatch").arg("--parsable").arg(script).output();
    let output = output.map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => anyhow!(
            "sbatch is not on this machine: send {} with it from a login node of the cluster",
            script.display()
        ),
        _ => anyhow::Error::new(error).context("sbatch cannot be started"),
    })?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        return Err(Failure::Failed(anyhow!(
            "sbatch refuses {}: {}; change the options (--force replaces the script), or edit it",
            script.display(),
            said.trim()
        )));
    }
    // JOB, or JOB;CLUSTER
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_one_word_for_sbatch_and_for_the_shell() {
        assert_eq!(directive("time", "1-00:30").ok().as_deref(), Some("#SBATCH --time=1-00:30"));
        assert_eq!(directive("chdir", "/a b").ok().as_deref(), Some("#SBATCH --chdir=\"/a b\""));
        assert!(directive("chdir", "a\"b").is_err());
        assert_eq!(shell_word("it's $HOME"), r"'it'\''s $HOME'");
    }
}
