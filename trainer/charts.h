#pragma once

#include <trainer/instructor.h>
#include <trainer/look.h>
#include <trainer/progress.h>

#include <vector>

/// Pictures of numbers. Not part of the interface.
namespace palpate::trainer {

struct ChartLine {
    const Curve* curve;
    Rgb colour;
};

/// A value that a tick of an axis stands at, for a range and at most so many of them: 1, 2 or 5 times a power of ten apart.
std::vector<double> ticksOf(double low, double high, int most);

/// Draws curves by session, from 1 on, with their levels as lines across. Curves are told apart by their marks too.
/// @pre  at least one
/// @param wide, high  of all of it [pixels]
void drawCurves(const std::vector<ChartLine>& lines, float wide, float high);

/// Draws each group's values of a measure along one axis: dots, quartiles as a box, the median as a line.
void drawSpreads(const ComparedMeasure& measure, float wide, float high);

/// Colour of a group, by its number.
Rgb groupColour(std::size_t group) noexcept;

}  // namespace palpate::trainer
