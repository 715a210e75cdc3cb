"""Where traffic keeps left, for maps that do not say it: boxes that lie within such countries, none across a border."""

from __future__ import annotations

from typing import Final

# South, north (latitude), west, east (longitude), in degrees; only what a box covers wholly is called left.
KEEP_LEFT: Final[tuple[tuple[float, float, float, float], ...]] = (
    (49.9, 61.0, -8.7, 0.8),  # Great Britain west of the Channel's narrows; the French coast begins at 49.8 here ...
    (51.1, 53.5, 0.8, 1.8),  # ... Kent, Suffolk and Norfolk
    (51.2, 55.5, -10.8, -5.3),  # Ireland
    (35.75, 36.15, 14.1, 14.7),  # Malta
    (34.5, 35.75, 32.2, 34.7),  # Cyprus
    (-44.0, -10.0, 112.0, 154.0),  # Australia
    (-48.0, -34.0, 166.0, 180.0),  # New Zealand
    (30.0, 41.6, 131.2, 142.5),  # Japan's main islands
    (31.0, 34.2, 129.6, 131.2),  # Kyushu
    (41.6, 45.6, 139.3, 145.3),  # Hokkaido
    (24.0, 30.0, 122.9, 131.0),  # Okinawa and the islands south of Kyushu
    (5.5, 26.4, 68.5, 92.0),  # India, Sri Lanka and most of Bangladesh
    (26.4, 30.5, 67.5, 78.5),  # Sindh, Punjab, Rajasthan and Delhi
    (30.5, 34.3, 72.6, 77.5),  # Lahore, Islamabad and the Indian Punjab
    (24.0, 30.0, 67.0, 68.5),  # Karachi
    (26.4, 27.7, 81.0, 88.0),  # Nepal's lowlands and Kathmandu
    (6.5, 16.5, 99.8, 102.2),  # Bangkok and the south of Thailand
    (-11.0, 6.4, 95.0, 119.0),  # Malaysia, Singapore, Brunei and western Indonesia
    (-8.8, 4.4, 119.0, 140.9),  # eastern Indonesia
    (22.19, 22.44, 113.95, 114.35),  # Hong Kong
    (-35.0, -18.1, 11.7, 41.0),  # South Africa, Namibia, Botswana, Zimbabwe, Mozambique
    (-18.1, -13.6, 24.2, 41.0),  # Zambia and Malawi
    (-11.5, -1.1, 31.0, 41.0),  # Tanzania
    (-4.8, 3.3, 34.0, 40.8),  # Kenya
    (-1.1, 3.3, 31.5, 34.0),  # Uganda
    (-20.6, -19.6, 57.2, 63.6),  # Mauritius
    (17.6, 18.6, -78.5, -76.1),  # Jamaica
    (10.0, 11.4, -61.75, -60.4),  # Trinidad and Tobago
    (13.0, 13.4, -59.7, -59.4),  # Barbados
    (23.4, 27.3, -78.9, -74.0),  # Bahamas
    (-19.5, -15.5, 177.0, 180.0),  # Fiji
)


def keeps_left_at(lat_deg: float, lon_deg: float) -> bool:
    """Whether traffic surely keeps left at a place. Near borders, and in small countries, nothing is known: False."""
    return any(south <= lat_deg <= north and west <= lon_deg <= east for south, north, west, east in KEEP_LEFT)
