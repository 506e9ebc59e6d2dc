#include "io/export/vtk.hpp"

#include <fmt/format.h>

#include <cstdint>
#include <cstring>
#include <numeric>

#include "io/export/frames.hpp"

namespace moraine {

namespace {

/// The appended data: each array behind its length in bytes.
class Appended {
 public:
  /// Adds an array and returns the offset to name in the header.
  template <class T>
  std::size_t add(const std::vector<T>& values) {
    const std::size_t offset = bytes_.size();
    const std::uint64_t length = values.size() * sizeof(T);
    append(&length, sizeof length);
    append(values.data(), length);
    return offset;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  void append(const void* from, std::size_t n) {
    if (n > 0) bytes_.append(static_cast<const char*>(from), n);
  }
  std::string bytes_;
};

std::string data_array(const char* type, const std::string& name, int components, std::size_t offset) {
  return fmt::format(
      "<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"appended\" offset=\"{}\"/>\n", type, name,
      components, offset);
}

std::string field_array(const FieldArray& array, Appended& data) {
  const FieldInfo& row = info(array.field);
  const std::string name(row.name);
  switch (row.type) {
    case FieldType::real: return data_array("Float64", name, row.components, data.add(array.reals));
    case FieldType::gid: return data_array("UInt64", name, 1, data.add(array.gids));
    default: return data_array("UInt16", name, 1, data.add(array.indices));
  }
}

}  // namespace

std::string vtp_text(const Image& image) {
  const FieldArray* positions = image.find(Field::position);
  if (positions == nullptr) throw ExportError("VTK files need the field position in the snapshot");
  Appended data;
  std::string text =
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n<PolyData>\n";
  text += fmt::format(
      "<FieldData>\n<DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" "
      "format=\"ascii\">{}</DataArray>\n</FieldData>\n",
      image.time);
  text += fmt::format(
      "<Piece NumberOfPoints=\"{0}\" NumberOfVerts=\"{0}\" NumberOfLines=\"0\" NumberOfStrips=\"0\" "
      "NumberOfPolys=\"0\">\n<PointData>\n",
      image.n_grains);
  for (const FieldArray& array : image.fields)
    if (array.field != Field::position) text += field_array(array, data);
  text += "</PointData>\n<Points>\n" + field_array(*positions, data) + "</Points>\n<Verts>\n";
  std::vector<std::int64_t> numbers(image.n_grains);
  std::iota(numbers.begin(), numbers.end(), 0);
  text += data_array("Int64", "connectivity", 1, data.add(numbers));
  std::iota(numbers.begin(), numbers.end(), 1);
  text += data_array("Int64", "offsets", 1, data.add(numbers));
  return text + "</Verts>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_" + data.bytes() +
         "\n</AppendedData>\n</VTKFile>\n";
}

std::string pvd_text(const std::vector<std::pair<double, std::string>>& frames) {
  std::string text =
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" "
      "byte_order=\"LittleEndian\">\n<Collection>\n";
  for (const auto& [time, file] : frames)
    text += fmt::format("<DataSet timestep=\"{}\" part=\"0\" file=\"{}\"/>\n", time, file);
  return text + "</Collection>\n</VTKFile>\n";
}

}  // namespace moraine
