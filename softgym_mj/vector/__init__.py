"""Many environments at once: one interface, and backends that run the simulations."""
