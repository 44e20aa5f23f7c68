//! Interprets a script's bytes as choices; after the end of the script, every choice is the first
//! option.

/// The bytes of a script that have not been used yet.
pub struct Choices<'a> {
    rest: &'a [u8],
}

impl<'a> Choices<'a> {
    pub fn new(script: &'a [u8]) -> Self {
        Self { rest: script }
    }

    pub fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    pub fn byte(&mut self) -> u8 {
        match self.rest.split_first() {
            Some((&first, rest)) => {
                self.rest = rest;
                first
            }
            None => 0,
        }
    }

    /// Chooses a number below `n`.
    pub fn below(&mut self, n: usize) -> usize {
        let wide = n > 256;
        let number = usize::from(self.byte()) | if wide { self.below(256) << 8 } else { 0 };
        number % n.max(1)
    }

    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }

    /// Chooses one of the numbers in `likely` or, if the byte is odd, any number.
    pub fn value(&mut self, likely: &[u16]) -> u16 {
        let choice = self.byte();
        match choice & 1 {
            0 => likely[usize::from(choice >> 1) % likely.len()],
            _ => u16::from_le_bytes([self.byte(), self.byte()]),
        }
    }

    /// Chooses a boundary value, at which a field of the protocol changes its meaning.
    pub fn word(&mut self) -> u32 {
        let choice = self.byte();
        match choice >> 4 {
            0 => u32::from(choice),
            1 => u32::MAX - u32::from(choice & 15),
            2 => 1 << (2 * (choice & 15)),
            3 => (1 << 20) + u32::from(choice & 15),
            4 => 1024 + u32::from(choice & 15),
            5 => u32::from(choice & 15) << 16,
            _ => u32::from_be_bytes([choice, self.byte(), self.byte(), self.byte()]),
        }
    }

    pub fn bytes(&mut self, most: usize) -> Vec<u8> {
        let len = self.below(most + 1);
        (0..len).map(|_| self.byte()).collect()
    }
}
