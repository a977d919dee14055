//! Pictures of some frames of a run whose length need not be known, in bounded memory.

use super::pictures::FramePictures;

/// Most frames of which a page shows pictures: a step of the slider is then still narrower than the thumb.
const MAX_FRAMES: usize = 48;

/// Largest stride that an album begins with, in frames a picture: a run that ends early still has some.
const MAX_FIRST_STRIDE: usize = 8;

/// Most bytes of pictures: the page holds 4/3 of them, as text.
const MAX_BYTES: usize = 5_600_000;

/// Bytes that all pictures of a frame need for each pixel of one, about: a larger value makes the pictures smaller. The
/// limit above holds whatever they need.
const BYTES_PER_PIXEL: f64 = 1.5;

/// Least and greatest width of a picture, in pixels.
const WIDTHS_PX: (f64, f64) = (320.0, 960.0);

/// Evenly spaced pictures, which thin themselves as the run goes on: every one, every second, every fourth …
#[derive(Debug, Clone)]
pub struct Album {
    pictures: Vec<FramePictures>,
    /// About so many pictures.
    expected: usize,
    stride: usize,
    offered: usize,
}

impl Album {
    /// An album of a run of about so many frames.
    pub fn of(frames: usize) -> Self {
        let stride = frames.div_ceil(MAX_FRAMES).next_power_of_two().min(MAX_FIRST_STRIDE);
        Self { pictures: Vec::new(), expected: frames.div_ceil(stride), stride, offered: 0 }
    }

    /// How wide to make pictures of images of `(width, height)`, so that those of all frames fit.
    pub fn width_px(&self, (width, height): (usize, usize)) -> usize {
        let pictures = self.expected.clamp(1, MAX_FRAMES) as f64;
        let pixels = MAX_BYTES as f64 / pictures / BYTES_PER_PIXEL;
        let fits = (pixels * width as f64 / height.max(1) as f64).sqrt();
        width.min(fits.clamp(WIDTHS_PX.0, WIDTHS_PX.1) as usize)
    }

    /// Offer the next frame; its pictures are made, and given back too, only if it is their turn.
    pub fn offer(&mut self, make: impl FnOnce() -> FramePictures) -> Option<FramePictures> {
        let made = self.accepts().then(make);
        self.recall(made.clone());
        made
    }

    /// The next frame again, with what an earlier album of the same run made of it.
    pub fn recall(&mut self, made: Option<FramePictures>) {
        let accepted = self.accepts();
        self.pictures.extend(made.filter(|_| accepted));
        self.offered += 1;
        while self.bytes() > MAX_BYTES && self.pictures.len() > 1 {
            self.thin();
        }
    }

    /// The pictures kept, in order.
    pub(crate) fn pictures(&self) -> &[FramePictures] {
        &self.pictures
    }

    /// Every so-many-th frame that was offered is kept.
    pub(crate) fn stride(&self) -> usize {
        self.stride
    }

    fn bytes(&self) -> usize {
        self.pictures.iter().map(FramePictures::bytes).sum()
    }

    /// Whether it is the next frame's turn; room is made for it.
    fn accepts(&mut self) -> bool {
        if self.pictures.len() == MAX_FRAMES && self.is_due() {
            self.thin();
        }
        self.is_due()
    }

    fn is_due(&self) -> bool {
        self.offered.is_multiple_of(self.stride)
    }

    /// Keep every other one, now and from here on.
    fn thin(&mut self) {
        let mut keep = false;
        self.pictures.retain(|_| {
            keep = !keep;
            keep
        });
        self.stride *= 2;
    }
}
