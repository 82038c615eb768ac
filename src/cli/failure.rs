//! How a command fails: one line that says what is wrong, another that says what to do, and an exit status.

use crate::image::picture::ImageError;
use crate::integrators::MethodError;
use crate::render::RenderError;
use crate::scene::mitsuba::SceneError;
use crate::study::error::StudyError;
use std::error::Error;
use std::process::ExitCode;

/// A command that did not do what it was asked for.
#[derive(Debug)]
pub(crate) struct Failure {
    message: String,
    /// Further lines: where it came from.
    via: Vec<String>,
    help: Option<String>,
    status: u8,
}

/// A command's result.
pub(crate) type Outcome = Result<ExitCode, Failure>;

impl Failure {
    /// Bad input: exit status 2.
    pub(crate) fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), via: Vec::new(), help: None, status: 2 }
    }

    /// Adds what to do.
    pub(crate) fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// An error with all it says about its causes, in one line.
    fn chain(error: &dyn Error) -> Self {
        let mut message = error.to_string();
        let mut source = error.source();
        while let Some(cause) = source {
            message.push_str(": ");
            message.push_str(&cause.to_string());
            source = cause.source();
        }
        Self::new(message)
    }

    /// Prints to standard error.
    pub(crate) fn report(&self) -> ExitCode {
        eprintln!("error: {}", self.message);
        for line in &self.via {
            eprintln!("  {line}");
        }
        if let Some(help) = &self.help {
            eprintln!("help: {help}");
        }
        ExitCode::from(self.status)
    }
}

impl From<ImageError> for Failure {
    fn from(error: ImageError) -> Self {
        Self::chain(&error)
    }
}

impl From<MethodError> for Failure {
    fn from(error: MethodError) -> Self {
        Self::chain(&error)
    }
}

impl From<RenderError> for Failure {
    fn from(error: RenderError) -> Self {
        let help = match &error {
            RenderError::Reference { .. } => Some("render at the reference's size with --resolution, or give a reference of this size"),
            _ => None,
        };
        Self { help: help.map(str::to_owned), ..Self::chain(&error) }
    }
}

impl From<StudyError> for Failure {
    fn from(error: StudyError) -> Self {
        match error {
            StudyError::Scene(error) => error.into(),
            StudyError::Image(error) => error.into(),
            error => Self { help: error.help(), ..Self::new(error.to_string()) },
        }
    }
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        let SceneError { position, message, help, via } = error;
        Self { message: format!("{position}: {message}"), via, help, status: 2 }
    }
}
