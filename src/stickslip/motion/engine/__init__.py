"""The event loop, compiled: steps and flights, events and impacts."""
