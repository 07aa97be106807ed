//! Bytes where they lie: files, and objects behind URLs.
