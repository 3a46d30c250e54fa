//! Questions about single rays and points keep their promises (docs/questions.md), in light and across a cluster.

mod cluster;
mod light;
mod measure;
mod mix;
mod raster;
mod world;
