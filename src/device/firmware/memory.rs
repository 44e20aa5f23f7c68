//! The device's memory: built-in and user-defined sequences, and images.

use super::super::PatternImage;
use super::settings::microseconds;
use image::GrayImage;
use phasmid_core::error::{Error, Result};
use phasmid_pattern::{Axis, Manifest, Pattern, ProjectorSize};
use phasmid_profile::{Profile, Projector};
use phasmid_protocol::scpi::{DeviceError, ErrorCode};
use phasmid_render::image_file;
use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Maximum number of sequences.
const MAX_SEQUENCES: usize = 128;
/// Maximum total size of images and pattern images in bytes.
const MAX_BYTES: usize = 512 << 20;
/// Maximum length of the name of a sequence or image.
const MAX_NAME: usize = 64;

/// A user-defined sequence that is loaded when the device starts.
#[derive(Debug, Clone)]
pub struct UserSequence {
    /// Name that `SEQuence:SELect` accepts.
    pub name: String,
    /// The patterns.
    pub manifest: Manifest,
    /// Folder to which image paths are relative.
    pub folder: PathBuf,
}

impl UserSequence {
    /// Reads a manifest file; the sequence takes the file's name without its extension.
    ///
    /// # Errors
    /// Returns an error if the manifest is invalid or the file name cannot be used as a name.
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
    pub(super) pattern_images: Vec<Arc<PatternImage>>,
    /// Shortest time for which the projector can show each pattern, in nanoseconds.
    pub(super) shortest_ns: u64,
    /// Time to load the sequence from flash memory, in nanoseconds.
    pub(super) load_ns: u64,
    /// Size of the pattern images in bytes.
    bytes: usize,
    built_in: bool,
}

#[derive(Clone)]
pub(super) struct Memory {
    projector: Projector,
    /// Period of a sequence whose manifest states none, in nanoseconds.
    period_ns: u64,
    sequences: Vec<Arc<Stored>>,
    pictures: BTreeMap<String, GrayImage>,
    /// See [`MAX_BYTES`].
    max_bytes: usize,
}

impl Memory {
    pub(super) fn new(profile: &Profile, user: &[UserSequence]) -> Result<Self> {
        Self::of_size(MAX_BYTES, profile, user)
    }

    fn of_size(max_bytes: usize, profile: &Profile, user: &[UserSequence]) -> Result<Self> {
        let mut memory = Self {
            projector: profile.projector.clone(),
            period_ns: microseconds(profile.sequence[0].period_us),
            sequences: Vec::new(),
            pictures: BTreeMap::new(),
            max_bytes,
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

    /// Loads a sequence whose images are files.
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
                "a name that is already used",
                "a name that no other sequence has",
            ));
        }
        self.check_projector(&manifest)
            .map_err(|found| Error::input(&place, found, "the profile's projector"))?;
        let bytes = self.pattern_image_bytes(&manifest);
        if self.sequences.len() >= MAX_SEQUENCES || bytes > self.room() {
            return Err(Error::input(
                place,
                "more than the device's memory holds",
                format!(
                    "{MAX_SEQUENCES} sequences and {} bytes of images",
                    self.max_bytes
                ),
            ));
        }
        let images = |file: &Path| image_file::read(&folder.join(file), &self.projector);
        let pattern_images = self.pattern_images(&manifest, &images)?;
        let stored = Stored {
            name: name.to_owned(),
            period_ns,
            manifest,
            pattern_images,
            shortest_ns: 0,
            load_ns: 0,
            bytes,
            built_in,
        };
        self.sequences.push(Arc::new(self.timed(stored)));
        Ok(())
    }

    /// Applies the projector's timing to a sequence: a period that is too short for its patterns is
    /// lengthened.
    fn timed(&self, mut stored: Stored) -> Stored {
        if let Some(timing) = &self.projector.timing {
            let bits = self.projector.bits;
            let patterns = || stored.manifest.frame.iter().map(|frame| &frame.pattern);
            stored.shortest_ns = timing.shortest_exposure_ns(patterns(), bits);
            stored.load_ns = timing.load_ns(patterns(), bits);
            let least_ns = timing.shortest_period_ns(stored.shortest_ns);
            stored.period_ns = stored.period_ns.max(least_ns);
        }
        stored
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

    pub(super) fn sequences(&self) -> impl Iterator<Item = &Arc<Stored>> {
        self.sequences.iter()
    }

    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.sequences.iter().map(|stored| stored.name.as_str())
    }

    /// Stores an image received over the control port.
    pub(super) fn upload(&mut self, file: &str, bytes: &[u8]) -> Result<(), DeviceError> {
        if file.is_empty() || file.len() > MAX_NAME || file.contains(char::is_control) {
            return Err(ErrorCode::IllegalParameterValue.with(format!(
                "expected a file name of 1 to {MAX_NAME} characters"
            )));
        }
        let projector = &self.projector;
        let image = image_file::decode(bytes, projector, file)
            .map_err(|e| ErrorCode::IllegalParameterValue.with(e))?;
        // Rejects an unsuitable image now rather than when a sequence uses it.
        PatternImage::from_image(&image, projector, file)
            .map_err(|e| ErrorCode::IllegalParameterValue.with(e))?;
        let before = self.pictures.get(file).map_or(0, |old| old.as_raw().len());
        if self.bytes() - before + image.as_raw().len() > self.max_bytes {
            return Err(ErrorCode::OutOfMemory.into());
        }
        self.pictures.insert(file.to_owned(), image);
        Ok(())
    }

    /// Defines a sequence from a manifest received over the control port, unless `refuse` returns an
    /// error for the sequence.
    pub(super) fn define(
        &mut self,
        name: &str,
        toml: &[u8],
        refuse: impl FnOnce(&Stored) -> Result<(), DeviceError>,
    ) -> Result<Arc<Stored>, DeviceError> {
        if !is_name(name) {
            return Err(ErrorCode::IllegalParameterValue
                .with("expected a name of 1 to 64 letters, digits, '-', '_' or '.'"));
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
        let place = self.sequences.iter().position(|old| old.name == name);
        if place.is_none() && self.sequences.len() >= MAX_SEQUENCES {
            return Err(ErrorCode::OutOfMemory.into());
        }
        let before = place.map_or(0, |index| self.sequences[index].bytes);
        let bytes = self.pattern_image_bytes(&manifest);
        if bytes > self.room() + before {
            return Err(ErrorCode::OutOfMemory.into());
        }
        let images = |file: &Path| Ok(self.pictures[&key(file)].clone());
        let pattern_images = self.pattern_images(&manifest, &images).map_err(failed)?;
        let stored = Arc::new(self.timed(Stored {
            name: name.to_owned(),
            period_ns: self.period_ns,
            manifest,
            pattern_images,
            shortest_ns: 0,
            load_ns: 0,
            bytes,
            built_in: false,
        }));
        refuse(&stored)?;
        match place {
            Some(index) => self.sequences[index] = stored.clone(),
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

    pub(super) fn delete_image(&mut self, file: &str) -> Result<(), DeviceError> {
        match self.pictures.remove(file) {
            Some(_) => Ok(()),
            None => Err(ErrorCode::FileNameNotFound.with(file)),
        }
    }

    /// Returns a pattern image for each frame; frames with the same pattern share one.
    fn pattern_images(
        &self,
        manifest: &Manifest,
        images: &dyn Fn(&Path) -> Result<GrayImage>,
    ) -> Result<Vec<Arc<PatternImage>>> {
        let mut made: HashMap<String, Arc<PatternImage>> = HashMap::new();
        let mut pattern_images = Vec::with_capacity(manifest.frame.len());
        for frame in &manifest.frame {
            let pattern_image = match made.entry(key_of(&frame.pattern)) {
                Entry::Occupied(same) => same.get().clone(),
                Entry::Vacant(new) => {
                    let pattern_image = PatternImage::new(&frame.pattern, &self.projector, images)?;
                    new.insert(Arc::new(pattern_image)).clone()
                }
            };
            pattern_images.push(pattern_image);
        }
        Ok(pattern_images)
    }

    /// Returns the size in bytes of the result of [`Self::pattern_images`]. Computed before any
    /// allocation, because a manifest may have many frames that all name one large image.
    fn pattern_image_bytes(&self, manifest: &Manifest) -> usize {
        let (width, height) = (self.projector.width_px, self.projector.height_px);
        let (width, height) = (width as usize, height as usize);
        let mut counted = HashSet::new();
        let distinct = manifest
            .frame
            .iter()
            .map(|frame| &frame.pattern)
            .filter(|pattern| counted.insert(key_of(pattern)));
        let levels: usize = distinct
            .map(|pattern| match pattern {
                Pattern::Image { .. } => width.saturating_mul(height),
                _ => match pattern.axis() {
                    Some(Axis::X) => width,
                    Some(Axis::Y) => height,
                    None => 0,
                },
            })
            .sum();
        levels.saturating_mul(size_of::<u16>())
    }

    /// Free bytes.
    fn room(&self) -> usize {
        self.max_bytes.saturating_sub(self.bytes())
    }

    fn bytes(&self) -> usize {
        let pictures: usize = self.pictures.values().map(|p| p.as_raw().len()).sum();
        let pattern_images: usize = self.sequences.iter().map(|stored| stored.bytes).sum();
        pictures + pattern_images
    }
}

/// Returns a key that identifies a pattern. The key is exact, since the debug format writes each
/// number with the shortest decimal that reads back to the same number.
fn key_of(pattern: &Pattern) -> String {
    format!("{pattern:?}")
}

fn is_name(text: &str) -> bool {
    (1..=MAX_NAME).contains(&text.len())
        && text
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.'))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "[projector]\nwidth_px = 854\nheight_px = 480\n";

    fn fringes(count: usize, phase: impl Fn(usize) -> usize) -> String {
        let frame = |i| {
            format!(
                "[[frame]]\npattern = {{ kind = \"fringe\", axis = \"x\", period_px = 16, \
                 phase_rad = {}e-3 }}\n",
                phase(i)
            )
        };
        HEAD.to_owned() + &(0..count).map(frame).collect::<String>()
    }

    fn small(room: usize, user: &[UserSequence]) -> Result<Memory> {
        let profile = Profile::load("webcam-grey").unwrap();
        let own = Memory::new(&profile, &[]).unwrap().bytes();
        Memory::of_size(own + room, &profile, user)
    }

    #[test]
    fn rows_are_counted_and_equal_ones_shared() {
        let row = 854 * 2;
        let mut memory = small(100 * row, &[]).unwrap();
        let all = |_: &Stored| Ok(());
        let full = memory.define("own", fringes(101, |i| i).as_bytes(), all);
        assert_eq!(full.unwrap_err().code, ErrorCode::OutOfMemory);
        memory
            .define("own", fringes(100, |i| i).as_bytes(), all)
            .unwrap();
        assert_eq!(memory.room(), 0);
        let full = memory.define("other", fringes(1, |i| i).as_bytes(), all);
        assert_eq!(full.unwrap_err().code, ErrorCode::OutOfMemory);
        // A sequence that replaces itself reuses its own space, and frames with the same pattern
        // count once.
        let stored = memory
            .define("own", fringes(4096, |i| i % 2).as_bytes(), all)
            .unwrap();
        assert_eq!(memory.room(), 98 * row);
        assert!(Arc::ptr_eq(
            &stored.pattern_images[0],
            &stored.pattern_images[4094]
        ));
        assert!(!Arc::ptr_eq(
            &stored.pattern_images[0],
            &stored.pattern_images[1]
        ));
    }

    #[test]
    fn a_sequence_too_large_is_refused_before_its_pictures_are_read() {
        let frame =
            |i| format!("[[frame]]\npattern = {{ kind = \"image\", file = \"{i}.png\" }}\n");
        let text = HEAD.to_owned() + &(0..5).map(frame).collect::<String>();
        let user = UserSequence {
            name: "own".into(),
            manifest: Manifest::parse(&text, "own").unwrap(),
            folder: PathBuf::from("/no/such/folder"),
        };
        let refusal = |pictures: usize| {
            let room = pictures * 854 * 480 * 2;
            let result = small(room, std::slice::from_ref(&user));
            result.err().unwrap().to_string()
        };
        assert!(refusal(4).contains("memory"), "{}", refusal(4));
        assert!(refusal(5).contains("0.png"), "{}", refusal(5));
    }
}
