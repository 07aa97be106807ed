//! Frames in shared memory.

use bus::HeldState;
use rustix::io::Errno;
use rustix::mm::{MapFlags, MprotectFlags, MremapFlags, ProtFlags, mmap_anonymous, mprotect, mremap_fixed};
use schemas::frame::Frame as StateFrame;
use std::process;
use std::ptr::{copy_nonoverlapping, null_mut};
use std::sync::{Mutex, PoisonError};

/// A frame in shared memory.
pub(super) struct Shared {
    pub(super) frame: StateFrame<'static>,
    /// Keeps the memory; needed by nobody but `frame`.
    state: Mutex<Option<HeldState>>,
    /// The process that is attached; one that was forked from it gives nothing back.
    process: u32,
}

impl Drop for Shared {
    fn drop(&mut self) {
        if self.process != process::id() {
            std::mem::forget(self.state.get_mut().unwrap_or_else(PoisonError::into_inner).take());
        }
    }
}

impl Shared {
    pub(super) fn new(state: HeldState) -> Self {
        #[expect(unsafe_code, reason = "the frame and what it borrows from live together")]
        // SAFETY: the slices lie in shared memory that is mapped for as long as `state` lives, wherever `state` itself
        // moves, and nobody writes to it until the source leaves; `seal` comes before that. They leave this struct only
        // as arrays that own a reference to it.
        let frame = unsafe { std::mem::transmute::<StateFrame<'_>, StateFrame<'static>>(state.frame()) };
        Self { frame, state: Mutex::new(Some(state)), process: process::id() }
    }

    /// Puts a copy of this process's own in the place of the pages under the frame: a producer that goes on without us takes
    /// its memory back, but arrays stay as they are.
    pub(super) fn seal(&self) -> Result<(), Errno> {
        let page = rustix::param::page_size();
        let parts = [self.frame.u_m, self.frame.v_m_s, self.frame.extra].map(<[f64]>::as_ptr_range);
        let parts = || parts.iter().filter(|part| !part.is_empty());
        let (Some(first), Some(last)) =
            (parts().map(|part| part.start).min(), parts().map(|part| part.end).max())
        else {
            return Ok(());
        };
        let begin = first.cast::<u8>().wrapping_sub(first.addr() % page).cast_mut();
        let bytes = (last.addr() - begin.addr()).next_multiple_of(page);
        #[expect(
            unsafe_code,
            reason = "arrays point to these addresses, so the memory has to change under them"
        )]
        // SAFETY: mappings begin and end at pages, so all these pages belong to the mapping of the frame, which this
        // consumer has alone and only reads. Afterwards each byte of a frame that is held has the value that it had:
        // all frames are sealed before the source leaves. Bytes between frames may be written by the producer
        // meanwhile; nobody reads them. The exchange of the pages is atomic to other threads.
        unsafe {
            let copy =
                mmap_anonymous(null_mut(), bytes, ProtFlags::READ | ProtFlags::WRITE, MapFlags::PRIVATE)?;
            copy_nonoverlapping(begin, copy.cast(), bytes);
            mprotect(copy, bytes, MprotectFlags::READ)?;
            mremap_fixed(copy, bytes, bytes, MremapFlags::MAYMOVE, begin.cast())?;
        }
        Ok(())
    }
}
