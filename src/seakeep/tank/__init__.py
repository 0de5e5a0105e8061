"""The virtual towing tank: a moored vessel with a moon pool in head seas, with known physics."""
