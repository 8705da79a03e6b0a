"""The colours of recordings, reports and markers: red, green, blue, each 0 to 255."""

Colour = tuple[int, int, int]

BLUE, ORANGE, GREEN = (90, 160, 230), (240, 150, 50), (110, 190, 110)
RED, VIOLET, GREY = (220, 80, 80), (160, 120, 210), (150, 150, 150)
BEFORE, AFTER = BLUE, ORANGE
SPIN_BEFORE, SPIN_AFTER = (60, 110, 170), (180, 100, 20)
REGIMES = {"STICKING": GREEN, "SLIDING": BLUE, "REVERSED": ORANGE, "JAMMED": RED, "SEPARATING": GREY}
