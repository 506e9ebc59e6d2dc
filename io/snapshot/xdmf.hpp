// The text of XDMF files (version 2, as ParaView's standard reader knows it) that show HDF5 files as a series in time.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>

#include "kernels/base/box.hpp"

namespace moraine::xdmf {

/// By step: the grid of one moment.
using Entries = std::map<std::uint64_t, std::string>;

/// Names are free text.
std::string escaped(const std::string& text);

/// The grid of one moment, of one part or of several side by side.
std::string entry(std::uint64_t step, double time, const std::string& content);
std::string entry_of_parts(std::uint64_t step, double time, const std::string& parts);
std::string part(const std::string& name, const std::string& content);

/// The whole file, and the entries of a file that we wrote.
std::string series(const std::string& name, const Entries& entries);
Entries parse(const std::string& text);

/// `shape`: "3 4 5". `type`: "Float" of eight bytes, or "Int" of so many.
std::string data_item(const std::string& file, const std::string& dataset, const std::string& shape,
                      const char* type = "Float", int bytes = 8);
std::string attribute(const std::string& name, const char* kind, const char* centre, const std::string& item);

/// Topology and geometry of uniform cells, and a quantity on them.
std::string cells(const std::array<int, 3>& n, const Box& box);
std::string on_cells(const std::string& name, const std::array<int, 3>& n, const std::string& file,
                     const std::string& dataset);

}  // namespace moraine::xdmf
