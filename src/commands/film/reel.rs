//! Pictures on their way into a file: by our own encoders, or through the user's ffmpeg.

use super::PER_SECOND;
use crate::args::FilmArgs;
use crate::failure::Failure;
use crate::outputs::extension;
use anyhow::anyhow;
use figure::{Apng, Dots, Gif};
use schemas::whole_file::WholeFile;
use std::fs::File;
use std::io::{self, BufWriter, ErrorKind, Read as _, Seek as _, Write as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;

/// Format of a film.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    Gif,
    Apng,
    Mp4,
    Webm,
}

/// The encoder that ffmpeg is asked for: a quality that the eye takes for the original, in colours that every player knows.
const MP4: &[&str] =
    &["-c:v", "libx264", "-preset", "medium", "-crf", "18", "-movflags", "+faststart", "-f", "mp4"];
const WEBM: &[&str] =
    &["-c:v", "libvpx-vp9", "-crf", "24", "-b:v", "0", "-row-mt", "1", "-cpu-used", "4", "-f", "webm"];

impl Form {
    /// The format by the end of a file's name.
    pub(super) fn of(path: &Path) -> Result<Self, Failure> {
        match extension(path).as_str() {
            "gif" => Ok(Self::Gif),
            "apng" | "png" => Ok(Self::Apng),
            "mp4" => Ok(Self::Mp4),
            "webm" => Ok(Self::Webm),
            _ => Err(bad_input!("{}: a film is written as .mp4, .webm, .gif or .apng", path.display())),
        }
    }

    /// Refuses a format whose encoder is not there.
    pub(super) fn check(self) -> Result<(), Failure> {
        if !matches!(self, Self::Mp4 | Self::Webm) {
            return Ok(());
        }
        let asked = Command::new("ffmpeg").arg("-version").stdin(Stdio::null()).output();
        asked.map(drop).map_err(|error| {
            let found = if error.kind() == ErrorKind::NotFound { "is not in PATH".into() } else { error.to_string() };
            bad_input!(
                "a film as .mp4 or .webm needs the program ffmpeg, which {found}; install it, or end the file's name with .gif or .apng"
            )
        })
    }
}

/// A film in the making; it has its name only when it is finished.
pub(super) struct Reel {
    file: WholeFile,
    encoder: Encoder,
}

enum Encoder {
    Gif(Box<Gif<BufWriter<Arc<File>>>>),
    Apng(Box<Apng<BufWriter<Arc<File>>>>),
    Ffmpeg(Ffmpeg),
}

impl Reel {
    /// Begins a film of so many pictures like `sample`.
    pub(super) fn begin(form: Form, args: &FilmArgs, count: usize, sample: &Dots) -> Result<Self, Failure> {
        let mut file = WholeFile::create(&args.out, args.force)?;
        let to = || BufWriter::new(Arc::clone(file.file()));
        let count = u32::try_from(count)?;
        let encoder = match form {
            Form::Gif => Gif::new(to(), sample, PER_SECOND).map(|gif| Encoder::Gif(Box::new(gif))),
            Form::Apng => {
                Apng::new(to(), args.size, count, PER_SECOND).map(|apng| Encoder::Apng(Box::new(apng)))
            }
            Form::Mp4 => Ffmpeg::start(args.size, MP4, file.partial()).map(Encoder::Ffmpeg),
            Form::Webm => Ffmpeg::start(args.size, WEBM, file.partial()).map(Encoder::Ffmpeg),
        };
        let encoder = encoder.map_err(|error| file.refused(error))?;
        Ok(Self { file, encoder })
    }

    /// Adds the next picture.
    pub(super) fn push(&mut self, picture: Dots) -> Result<(), Failure> {
        let pushed = match &mut self.encoder {
            Encoder::Gif(gif) => gif.push(picture),
            Encoder::Apng(apng) => apng.push(picture),
            Encoder::Ffmpeg(ffmpeg) => return ffmpeg.push(&picture),
        };
        Ok(pushed.map_err(|error| self.file.refused(error))?)
    }

    /// Writes the end, and gives the file its name.
    pub(super) fn finish(mut self) -> Result<(), Failure> {
        let finished = match self.encoder {
            Encoder::Gif(gif) => gif.finish(),
            Encoder::Apng(apng) => apng.finish(),
            Encoder::Ffmpeg(ffmpeg) => {
                ffmpeg.finish()?;
                Ok(())
            }
        };
        finished.map_err(|error| self.file.refused(error))?;
        self.file.publish()?;
        Ok(())
    }
}

/// The user's ffmpeg, which takes pictures on its stdin. It is killed when dropped before its end.
struct Ffmpeg {
    child: Child,
    /// Its stderr.
    said: File,
}

impl Ffmpeg {
    fn start((width, height): (u32, u32), codec: &[&str], to: &Path) -> io::Result<Self> {
        let said = tempfile::tempfile()?;
        let mut command = Command::new("ffmpeg");
        command.args(["-hide_banner", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgba"]);
        command.args(["-s", &format!("{width}x{height}"), "-r", &PER_SECOND.to_string(), "-i", "-", "-an"]);
        // the colours of high definition, and said to be; without it players guess by the size
        command.args(["-vf", "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p"]);
        command.args(["-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709"]);
        command.args(codec).arg(to);
        // Ctrl-C is for this program, which ends the other one
        system::apart(&mut command);
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(said.try_clone()?);
        Ok(Self { child: command.spawn()?, said })
    }

    fn push(&mut self, picture: &Dots) -> Result<(), Failure> {
        let stdin = self.child.stdin.as_mut();
        let written = stdin.map_or(Err(ErrorKind::BrokenPipe.into()), |stdin| stdin.write_all(&picture.rgba));
        written.map_err(|error| {
            // one that gave up says why
            drop(self.child.stdin.take());
            let _ = self.child.wait();
            self.failed(&error.to_string())
        })
    }

    fn finish(mut self) -> Result<(), Failure> {
        drop(self.child.stdin.take());
        let status = self.child.wait()?;
        if status.success() { Ok(()) } else { Err(self.failed(&status.to_string())) }
    }

    /// The failure with the end of what ffmpeg said, or else with `why`.
    fn failed(&mut self, why: &str) -> Failure {
        /// Characters that a person reads.
        const MOST: usize = 1000;
        let mut said = Vec::new();
        // at best: the failure itself is told in any case
        let _ = self.said.rewind().and_then(|()| self.said.read_to_end(&mut said));
        let said = String::from_utf8_lossy(&said);
        let said = said.trim();
        let begin = said.char_indices().rev().nth(MOST).map_or(0, |(place, _)| place);
        let said = if said.is_empty() { why } else { &said[begin..] };
        let why = "ffmpeg made no film; a .gif or an .apng needs none";
        Failure::Failed(anyhow!(said.to_owned()).context(why))
    }
}

impl Drop for Ffmpeg {
    fn drop(&mut self) {
        // of one that has ended both do nothing
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
