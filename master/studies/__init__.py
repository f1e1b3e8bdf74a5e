"""Commands of their own: benchmarks, stability cases, hard cases."""
