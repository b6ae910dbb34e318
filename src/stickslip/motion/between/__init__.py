"""The motion between its knots, compiled: values, pictures, and the audit."""
