#include "io/export/vtk.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <span>

#include "io/checkpoint/image_file.hpp"
#include "io/export/frames.hpp"
#include "io/snapshot/xdmf.hpp"

namespace moraine {

namespace {

/// The appended data: each array behind its length in bytes.
class Appended {
 public:
  /// Adds an array and returns the offset to name in the header.
  template <class T>
  std::size_t add(std::span<const T> values) {
    const std::size_t offset = bytes_.size();
    const std::uint64_t length = values.size() * sizeof(T);
    append(&length, sizeof length);
    append(values.data(), length);
    return offset;
  }
  template <class T>
  std::size_t add(const std::vector<T>& values) {
    return add(std::span<const T>(values));
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

const char* type_word(FieldType type) {
  return type == FieldType::real ? "Float64" : type == FieldType::gid ? "UInt64" : "UInt16";
}

std::string field_array(const FieldArray& array, GrainRows rows, Appended& data) {
  const FieldInfo& row = info(array.field);
  const auto those = [&](const auto& values) {
    const auto n = static_cast<std::size_t>(row.components);
    return std::span(values).subspan(n * rows.begin, n * (rows.end - rows.begin));
  };
  const std::size_t offset = row.type == FieldType::real  ? data.add(those(array.reals))
                             : row.type == FieldType::gid ? data.add(those(array.gids))
                                                          : data.add(those(array.indices));
  return data_array(type_word(row.type), std::string(row.name), row.components, offset);
}

/// Of a .pvtp: what the pieces' array is like.
std::string array_of_pieces(const FieldArray& array) {
  const FieldInfo& row = info(array.field);
  return fmt::format("<PDataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\"/>\n", type_word(row.type), row.name,
                     row.components);
}

const FieldArray& positions_of(const Image& image) {
  const FieldArray* positions = image.find(Field::position);
  if (positions == nullptr) throw ExportError("VTK files need the field position in the snapshot");
  return *positions;
}

std::string time_value(double time) {
  return fmt::format(
      "<FieldData>\n<DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" "
      "format=\"ascii\">{}</DataArray>\n</FieldData>\n",
      time);
}

/// Scalars, and vectors of three that follow each other.
std::string cell_arrays(const std::vector<const GridArray*>& arrays, Appended& data) {
  std::string text;
  for (std::size_t i = 0; i < arrays.size(); ++i) {
    const std::string& name = arrays[i]->name;
    const std::string stem = name.ends_with("_x") ? name.substr(0, name.size() - 2) : std::string();
    const bool is_vector = !stem.empty() && i + 2 < arrays.size() && arrays[i + 1]->name == stem + "_y" &&
                           arrays[i + 2]->name == stem + "_z";
    if (!is_vector) {
      text += data_array("Float64", xdmf::escaped(name), 1, data.add(arrays[i]->values));
      continue;
    }
    std::vector<double> values;
    for (std::size_t cell = 0; cell < arrays[i]->values.size(); ++cell)
      for (std::size_t axis = 0; axis < 3; ++axis) values.push_back(arrays[i + axis]->values[cell]);
    text += data_array("Float64", xdmf::escaped(stem), 3, data.add(values));
    i += 2;
  }
  return text;
}

/// Those of the quantities that are on the cells.
std::string cells_text(const std::array<int, 3>& n, const Box& box, double time, const std::vector<GridArray>& grids) {
  std::vector<const GridArray*> arrays;
  for (const GridArray& array : grids)
    if (array.n == n) arrays.push_back(&array);
  std::sort(arrays.begin(), arrays.end(), [](const GridArray* a, const GridArray* b) { return a->name < b->name; });
  const Vec3 low = box.low, size = box.size();
  const std::string extent = fmt::format("0 {} 0 {} 0 {}", n[0], n[1], n[2]);
  Appended data;
  std::string text =
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n";
  text += fmt::format("<ImageData WholeExtent=\"{}\" Origin=\"{} {} {}\" Spacing=\"{} {} {}\">\n", extent, low.x, low.y,
                      low.z, size.x / n[0], size.y / n[1], size.z / n[2]);
  text += time_value(time) + fmt::format("<Piece Extent=\"{}\">\n<CellData>\n", extent) + cell_arrays(arrays, data);
  return text + "</CellData>\n</Piece>\n</ImageData>\n<AppendedData encoding=\"raw\">\n_" + data.bytes() +
         "\n</AppendedData>\n</VTKFile>\n";
}

}  // namespace

std::string vti_text(const Image& image) {
  return image.grids.empty() ? std::string() : cells_text(gas_cells(image), image.domain, image.time, image.grids);
}

std::string vti_text(const FieldImage& fields) { return cells_text(fields.n, fields.box, fields.time, fields.arrays); }

std::string vtp_text(const WallMap& map, double time) {
  Appended data;
  std::string text =
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n<PolyData>\n";
  text += time_value(time);
  text += fmt::format(
      "<Piece NumberOfPoints=\"{}\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" "
      "NumberOfPolys=\"{}\">\n<CellData>\n",
      3 * map.n_triangles(), map.n_triangles());
  text += data_array("Float64", "force", 3, data.add(map.force)) +
          data_array("Float64", "pressure", 1, data.add(map.pressure)) +
          data_array("Float64", "shear", 1, data.add(map.shear));
  text +=
      "</CellData>\n<Points>\n" + data_array("Float64", "points", 3, data.add(map.corners)) + "</Points>\n<Polys>\n";
  std::vector<std::int64_t> corners(3 * map.n_triangles()), ends;
  std::iota(corners.begin(), corners.end(), 0);
  for (std::size_t t = 1; t <= map.n_triangles(); ++t) ends.push_back(static_cast<std::int64_t>(3 * t));
  text += data_array("Int64", "connectivity", 1, data.add(corners)) + data_array("Int64", "offsets", 1, data.add(ends));
  return text + "</Polys>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_" + data.bytes() +
         "\n</AppendedData>\n</VTKFile>\n";
}

std::string vtp_text(const Image& image, GrainRows rows) {
  const FieldArray& positions = positions_of(image);
  const std::uint64_t n_grains = rows.end - rows.begin;
  Appended data;
  std::string text =
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n<PolyData>\n";
  text += time_value(image.time);
  text += fmt::format(
      "<Piece NumberOfPoints=\"{0}\" NumberOfVerts=\"{0}\" NumberOfLines=\"0\" NumberOfStrips=\"0\" "
      "NumberOfPolys=\"0\">\n<PointData>\n",
      n_grains);
  for (const FieldArray& array : image.fields)
    if (array.field != Field::position) text += field_array(array, rows, data);
  text += "</PointData>\n<Points>\n" + field_array(positions, rows, data) + "</Points>\n<Verts>\n";
  std::vector<std::int64_t> numbers(n_grains);
  std::iota(numbers.begin(), numbers.end(), 0);
  text += data_array("Int64", "connectivity", 1, data.add(numbers));
  std::iota(numbers.begin(), numbers.end(), 1);
  text += data_array("Int64", "offsets", 1, data.add(numbers));
  return text + "</Verts>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_" + data.bytes() +
         "\n</AppendedData>\n</VTKFile>\n";
}

std::string pvtp_text(const Image& image, const std::vector<std::string>& pieces) {
  std::string text =
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"PPolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n<PPolyData GhostLevel=\"0\">\n";
  text += time_value(image.time) + "<PPointData>\n";
  for (const FieldArray& array : image.fields)
    if (array.field != Field::position) text += array_of_pieces(array);
  text += "</PPointData>\n<PPoints>\n" + array_of_pieces(positions_of(image)) + "</PPoints>\n";
  for (const std::string& piece : pieces) text += fmt::format("<Piece Source=\"{}\"/>\n", piece);
  return text + "</PPolyData>\n</VTKFile>\n";
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
