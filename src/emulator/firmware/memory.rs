//! The device's memory: sequences that came with it and those that a user loaded, and pictures.

use super::super::{Slide, picture};
use super::settings::microseconds;
use crate::error::{Error, Result};
use crate::pattern::{Manifest, Pattern, ProjectorSize};
use crate::profile::{Profile, Projector};
use crate::protocol::scpi::{DeviceError, ErrorCode};
use image::GrayImage;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Sequences that fit.
const MAX_SEQUENCES: usize = 128;
/// Bytes that pictures and slides may take.
const MAX_BYTES: usize = 512 << 20;
/// Longest name of a sequence or picture.
const MAX_NAME: usize = 64;

/// A sequence of a user's own, loaded when the device starts.
#[derive(Debug, Clone)]
pub struct UserSequence {
    /// Name by which `SEQuence:SELect` takes it.
    pub name: String,
    /// Its patterns.
    pub manifest: Manifest,
    /// Folder that its pictures are relative to.
    pub folder: PathBuf,
}

impl UserSequence {
    /// Reads a manifest file; the sequence bears the file's name without its extension.
    ///
    /// # Errors
    /// What the manifest's reader refuses, and a file name that is no name.
    pub fn read(path: &Path) -> Result<Self> {
        let manifest = Manifest::read(path)?;
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        if !is_name(&stem) {
            return Err(Error::input(
                path.display(),
                format!("the name {stem:?}"),
                "a file name of 1 to 64 letters, digits, '-', '_' or '.'",
            ));
        }
        Ok(Self {
            name: stem.into_owned(),
            manifest,
            folder: path.parent().unwrap_or(Path::new("")).to_path_buf(),
        })
    }
}

/// A sequence in memory.
#[derive(Debug)]
pub(super) struct Stored {
    pub(super) name: String,
    pub(super) period_ns: u64,
    pub(super) manifest: Manifest,
    pub(super) slides: Vec<Arc<Slide>>,
    built_in: bool,
}

pub(super) struct Memory {
    projector: Projector,
    /// Period of sequences that state none.
    period_ns: u64,
    sequences: Vec<Arc<Stored>>,
    pictures: BTreeMap<String, GrayImage>,
}

impl Memory {
    pub(super) fn new(profile: &Profile, user: &[UserSequence]) -> Result<Self> {
        let mut memory = Self {
            projector: profile.projector.clone(),
            period_ns: microseconds(profile.sequence[0].period_us),
            sequences: Vec::new(),
            pictures: BTreeMap::new(),
        };
        for sequence in &profile.sequence {
            memory.load(
                &sequence.name,
                microseconds(sequence.period_us),
                profile.manifest(sequence),
                &profile.folder,
                true,
            )?;
        }
        for sequence in user {
            let manifest = sequence.manifest.clone();
            let period_ns = memory.period_ns;
            memory.load(&sequence.name, period_ns, manifest, &sequence.folder, false)?;
        }
        Ok(memory)
    }

    /// Loads a sequence whose pictures are files.
    fn load(
        &mut self,
        name: &str,
        period_ns: u64,
        manifest: Manifest,
        folder: &Path,
        built_in: bool,
    ) -> Result<()> {
        let place = format!("sequence {name}");
        if self.get(name).is_some() {
            return Err(Error::input(
                place,
                "a name that is taken",
                "a name that no other sequence has",
            ));
        }
        self.check_projector(&manifest)
            .map_err(|found| Error::input(&place, found, "the profile's projector"))?;
        let projector = &self.projector;
        let slides = manifest
            .frame
            .iter()
            .map(|frame| {
                let images = |file: &Path| picture::read(&folder.join(file), projector);
                Slide::new(&frame.pattern, projector, &images).map(Arc::new)
            })
            .collect::<Result<_>>()?;
        self.sequences.push(Arc::new(Stored {
            name: name.to_owned(),
            period_ns,
            manifest,
            slides,
            built_in,
        }));
        if self.bytes() > MAX_BYTES || self.sequences.len() > MAX_SEQUENCES {
            return Err(Error::input(
                place,
                "more than the device's memory holds",
                format!("{MAX_SEQUENCES} sequences and {MAX_BYTES} bytes of pictures"),
            ));
        }
        Ok(())
    }

    fn check_projector(&self, manifest: &Manifest) -> Result<(), String> {
        let ProjectorSize {
            width_px,
            height_px,
        } = manifest.projector;
        if (width_px, height_px) == (self.projector.width_px, self.projector.height_px) {
            return Ok(());
        }
        Err(format!(
            "a projector of {width_px} x {height_px}, this one has {} x {}",
            self.projector.width_px, self.projector.height_px
        ))
    }

    pub(super) fn get(&self, name: &str) -> Option<&Arc<Stored>> {
        self.sequences.iter().find(|stored| stored.name == name)
    }

    pub(super) fn first(&self) -> &Arc<Stored> {
        &self.sequences[0]
    }

    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.sequences.iter().map(|stored| stored.name.as_str())
    }

    /// Keeps a picture that came over the port.
    pub(super) fn upload(&mut self, file: &str, bytes: &[u8]) -> Result<(), DeviceError> {
        if file.is_empty() || file.len() > MAX_NAME || file.contains(char::is_control) {
            return Err(ErrorCode::IllegalParameterValue.with(format!(
                "a file name of 1 to {MAX_NAME} characters is wanted"
            )));
        }
        let projector = &self.projector;
        let image = picture::decode(bytes, projector, file)
            .map_err(|e| ErrorCode::IllegalParameterValue.with(e))?;
        // Refused here rather than when a sequence is made of it.
        Slide::from_image(&image, projector, file)
            .map_err(|e| ErrorCode::IllegalParameterValue.with(e))?;
        let before = self.pictures.get(file).map_or(0, |old| old.as_raw().len());
        if self.bytes() - before + image.as_raw().len() > MAX_BYTES {
            return Err(ErrorCode::OutOfMemory.into());
        }
        self.pictures.insert(file.to_owned(), image);
        Ok(())
    }

    /// Makes a sequence of a manifest that came over the port.
    pub(super) fn define(&mut self, name: &str, toml: &[u8]) -> Result<Arc<Stored>, DeviceError> {
        if !is_name(name) {
            return Err(ErrorCode::IllegalParameterValue
                .with("a name is 1 to 64 letters, digits, '-', '_' or '.'"));
        }
        if self.get(name).is_some_and(|stored| stored.built_in) {
            return Err(ErrorCode::IllegalParameterValue.with(format!("{name} is built in")));
        }
        let failed = |e: Error| ErrorCode::ExecutionError.with(e);
        let text = std::str::from_utf8(toml)
            .map_err(|_| ErrorCode::ExecutionError.with("the manifest is not UTF-8"))?;
        let manifest = Manifest::parse(text, name).map_err(failed)?;
        self.check_projector(&manifest)
            .map_err(|found| ErrorCode::ExecutionError.with(found))?;
        let key = |file: &Path| file.to_str().unwrap_or_default().to_owned();
        for frame in &manifest.frame {
            if let Pattern::Image { file } = &frame.pattern
                && !self.pictures.contains_key(&key(file))
            {
                return Err(ErrorCode::FileNameNotFound.with(file.display()));
            }
        }
        // The slides' size is known before they are made: a manifest may name one picture often.
        let pictures = manifest
            .frame
            .iter()
            .filter(|frame| matches!(frame.pattern, Pattern::Image { .. }))
            .count();
        let before = self.get(name).map_or(0, |old| slide_bytes(old));
        let room = (MAX_BYTES + before).saturating_sub(self.bytes());
        if pictures.saturating_mul(self.picture_bytes()) > room {
            return Err(ErrorCode::OutOfMemory.into());
        }
        let images = |file: &Path| Ok(self.pictures[&key(file)].clone());
        let slides = manifest
            .frame
            .iter()
            .map(|frame| Slide::new(&frame.pattern, &self.projector, &images).map(Arc::new))
            .collect::<Result<_>>()
            .map_err(failed)?;
        let stored = Arc::new(Stored {
            name: name.to_owned(),
            period_ns: self.period_ns,
            manifest,
            slides,
            built_in: false,
        });
        let place = self.sequences.iter().position(|old| old.name == name);
        match place {
            Some(index) => self.sequences[index] = stored.clone(),
            None if self.sequences.len() >= MAX_SEQUENCES => {
                return Err(ErrorCode::OutOfMemory.into());
            }
            None => self.sequences.push(stored.clone()),
        }
        Ok(stored)
    }

    pub(super) fn delete(&mut self, name: &str) -> Result<(), DeviceError> {
        match self.get(name) {
            None => Err(ErrorCode::FileNameNotFound.with(name)),
            Some(stored) if stored.built_in => {
                Err(ErrorCode::IllegalParameterValue.with(format!("{name} is built in")))
            }
            Some(_) => {
                self.sequences.retain(|stored| stored.name != name);
                Ok(())
            }
        }
    }

    pub(super) fn delete_picture(&mut self, file: &str) -> Result<(), DeviceError> {
        match self.pictures.remove(file) {
            Some(_) => Ok(()),
            None => Err(ErrorCode::FileNameNotFound.with(file)),
        }
    }

    fn picture_bytes(&self) -> usize {
        2 * self.projector.width_px as usize * self.projector.height_px as usize
    }

    fn bytes(&self) -> usize {
        let pictures: usize = self.pictures.values().map(|p| p.as_raw().len()).sum();
        let slides: usize = self
            .sequences
            .iter()
            .map(|stored| slide_bytes(stored))
            .sum();
        pictures + slides
    }
}

fn slide_bytes(stored: &Stored) -> usize {
    stored
        .slides
        .iter()
        .map(|slide| match &**slide {
            Slide::Picture { levels, .. } => 2 * levels.len(),
            Slide::Row(_, levels) => 2 * levels.len(),
            Slide::Uniform(_) => 0,
        })
        .sum()
}

fn is_name(text: &str) -> bool {
    (1..=MAX_NAME).contains(&text.len())
        && text
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.'))
}
