// Names of the drag laws and of the ways in which grains and cells know of each other.
#pragma once

#include <string_view>

namespace moraine {

/// kernels/drag/README.md has their equations and papers.
enum class DragLaw { schiller_naumann, wen_yu, ergun, gidaspow, di_felice, syamlal_obrien, beetstra, koch_hill };

/// How a grain is spread over cells, and cell values are felt by a grain; always the same in both directions.
enum class GasWeights { cell, trilinear, smoothed };
constexpr std::string_view name_of(GasWeights weights) {
  return weights == GasWeights::cell ? "cell" : weights == GasWeights::trilinear ? "trilinear" : "smoothed";
}

/// Who carries the gas pressure (Gidaspow 1994): A, both phases in proportion to their volumes; B, the gas alone.
enum class GasModel { a, b };

}  // namespace moraine
