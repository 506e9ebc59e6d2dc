// Names of the drag laws and of the ways in which grains and cells know of each other.
#pragma once

namespace moraine {

/// kernels/drag/README.md has their equations and papers.
enum class DragLaw { schiller_naumann, wen_yu, ergun, gidaspow, di_felice, syamlal_obrien, beetstra, koch_hill };

/// How a grain is spread over cells, and cell values are felt by a grain; always the same in both directions.
enum class GasWeights { cell, trilinear, smoothed };

/// Who carries the gas pressure (Gidaspow 1994): A, both phases in proportion to their volumes; B, the gas alone.
enum class GasModel { a, b };

}  // namespace moraine
