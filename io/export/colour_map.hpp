// Colours for numbers: even steps of a value look like even steps of colour, also in grey and to colour-blind eyes.
#pragma once

namespace moraine {

/// sRGB, each 0 to 1.
struct Colour {
  double red = 0.0, green = 0.0, blue = 0.0;
};

/// Viridis (van der Walt & Smith 2015), from 0 (dark blue) to 1 (yellow); values outside take the ends.
Colour viridis(double value);

/// From nearly white to dark blue, for the gas, so that nobody takes it for grains.
Colour pale_to_blue(double value);

}  // namespace moraine
