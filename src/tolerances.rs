//! Every numerical tolerance of the engine, each with its derivation. No other file holds a bare tolerance.
