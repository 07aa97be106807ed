//! The JSON Schema of orbit files.

use super::Tables;
use producer::sweep::Grid;
use schemars::{JsonSchema, Schema};
use schemas::config::RunConfig;
use schemas::json_schema::{of, require_nothing};

/// The schema of orbit files.
pub fn schema() -> Schema {
    let about = "A chain, and the periodic orbit of it that is looked for.";
    let mut schema = of::<OrbitFile>("An orbit of Beadline", about);
    require_nothing(&mut schema, "");
    schema
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[expect(dead_code, reason = "the fields are read as keys alone")]
struct OrbitFile {
    #[schemars(flatten)]
    config: RunConfig,
    #[schemars(flatten)]
    tables: Tables,
    /// Keys with values, two of them for a map: an orbit at each point.
    grid: Option<Grid>,
}
