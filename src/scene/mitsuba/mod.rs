//! Mitsuba 3 XML to a scene.
