//! Metrics, experiments and reports: what came out, beside what the paper says.
