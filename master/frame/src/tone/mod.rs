//! From linear radiance to what a screen shows.
