//! Pages of results, and what is refused.
