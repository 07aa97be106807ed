//! The objects of a store, page by page, within bounds.

use super::client::Skips;
use super::store::{self, Directory, Store};
use super::wait;
use crate::{Listed, Listing, StorageError};
use futures_util::TryStreamExt as _;
use object_store::ObjectMeta;
use object_store::list::PaginatedListOptions;
use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError};

/// Objects of a listing: a thousand requests, and minutes.
const MOST_OBJECTS: u64 = 1_000_000;

/// Bytes of names that are kept: those of a million recordings of 128 bytes each.
const MOST_NAME_BYTES: u64 = 128 << 20;

/// Pages without an object, one after the other.
const MOST_EMPTY_PAGES: u32 = 100;

/// Adds the objects under the URL `root` whose path is `wanted` to `listing`.
pub(crate) fn list(
    root: &Path,
    wanted: &dyn Fn(&Path) -> bool,
    listing: &mut Listing,
) -> Result<(), StorageError> {
    let directory = store::of_directory(root)?;
    let mut bounds = Bounds { root, tokens: HashSet::new(), empty_pages: 0, name_bytes: 0 };
    let mut token = None;
    loop {
        let (page, next) = directory.page(token)?;
        bounds.count_page(page.len(), listing)?;
        for object in page {
            if directory.prefix.as_ref().is_some_and(|prefix| !object.location.prefix_matches(prefix)) {
                listing.skip(object.location.to_string(), "it is not below what was asked for".into());
                continue;
            }
            let path = PathBuf::from(format!("{}/{}", directory.base, object.location));
            if wanted(&path) {
                bounds.name_bytes += path.as_os_str().len() as u64;
                listing.entries.push(Listed { path, bytes: object.size });
            }
        }
        directory.take_skipped(listing);
        bounds.check(listing)?;
        let Some(next) = next.filter(|next| !next.is_empty()) else { return Ok(()) };
        bounds.check_token(&next, listing)?;
        token = Some(next);
    }
}

impl Directory {
    /// The page of the listing for `token`, or the first one, and the token of the next one.
    fn page(&self, token: Option<String>) -> Result<(Vec<ObjectMeta>, Option<String>), StorageError> {
        let prefix = self.prefix.clone();
        let Store { objects, pages } = &self.store;
        if let Some(pages) = pages.clone() {
            return wait(async move {
                let prefix = prefix.map(|prefix| format!("{prefix}/"));
                let options = PaginatedListOptions { page_token: token, ..PaginatedListOptions::default() };
                let page = pages.list_paginated(prefix.as_deref(), options).await.map_err(store::refused)?;
                Ok((page.result.objects, page.page_token))
            });
        }
        let objects = Arc::clone(objects);
        wait(async move {
            let all: Vec<_> = objects.list(prefix.as_ref()).try_collect().await.map_err(store::refused)?;
            Ok((all, None))
        })
    }

    /// Notes the objects that were left out of the last page.
    fn take_skipped(&self, listing: &mut Listing) {
        let mut skipped = self.skipped.lock().unwrap_or_else(PoisonError::into_inner);
        let Skips { names, count } = std::mem::take(&mut *skipped);
        let told = names.len() as u64;
        for name in names {
            let why = "its name is no plain path (`.`, `..`, an empty part, a control character)";
            listing.skip(format!("{}/{name}", self.base), why.into());
        }
        listing.skipped_count += count - told;
        listing.seen_count += count;
    }
}

/// The costs of a listing so far, which have bounds.
struct Bounds<'a> {
    root: &'a Path,
    /// Hashes of the tokens of the pages so far.
    tokens: HashSet<u64>,
    empty_pages: u32,
    name_bytes: u64,
}

impl Bounds<'_> {
    fn count_page(&mut self, objects: usize, listing: &mut Listing) -> Result<(), StorageError> {
        listing.seen_count += objects as u64;
        self.empty_pages = if objects == 0 { self.empty_pages + 1 } else { 0 };
        if self.empty_pages > MOST_EMPTY_PAGES {
            return Err(self.endless(listing, &format!("{MOST_EMPTY_PAGES} pages in a row were empty")));
        }
        Ok(())
    }

    fn check(&self, listing: &Listing) -> Result<(), StorageError> {
        if listing.seen_count > MOST_OBJECTS {
            return Err(self.endless(listing, &format!("at most {MOST_OBJECTS} are listed")));
        }
        if self.name_bytes > MOST_NAME_BYTES {
            return Err(self.endless(listing, "their names take more than 128 MiB"));
        }
        Ok(())
    }

    /// Refuses a token that was there before: the listing would begin again.
    fn check_token(&mut self, token: &str, listing: &Listing) -> Result<(), StorageError> {
        let mut hasher = DefaultHasher::new();
        token.hash(&mut hasher);
        if self.tokens.insert(hasher.finish()) {
            return Ok(());
        }
        Err(self.endless(listing, "the store repeats a continuation token, so that its listing never ends"))
    }

    fn endless(&self, listing: &Listing, why: &str) -> StorageError {
        let (seen, root) = (listing.seen_count, self.root.display());
        StorageError::Failed(format!(
            "{root} was given up after {seen} objects: {why}; name a folder with fewer objects in it"
        ))
    }
}
