// SPDX-License-Identifier: GPL-3.0-or-later
// What a glTF holds besides its JSON: the container, buffers, views of them, and
// accessors, which say what the numbers in a view are.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "io/formats/geometry.h"
#include "io/formats/gltf.h"
#include "io/formats/gltf_json.h"
#include "io/formats/stored_number.h"

namespace cellwarp::core
{

struct GltfView
{
    std::uint64_t start = 0, length = 0; ///< in the unpacked buffers [byte]
    std::uint64_t stride = 0;            ///< 0: elements stand one after the other
    bool is_compressed = false;          ///< in the file, by meshopt
};

/// Of a whole file: its buffers go to Geometry::unpacked. With a plan it takes no
/// numbers, and the input gives what the file's bytes lack. Throws Fault::Malformed,
/// Fault::File.
class GltfData
{
public:
    GltfData(GeometryFile& file, GltfLayout& layout, GltfPlan* plan,
             const InputFile* input);

    const GltfJson& json() const { return *json_; }
    const std::vector<GltfAccessor>& accessors() const { return layout_.accessors; }
    /// Size of all buffers and of unpacked data [byte].
    std::uint64_t body_bytes() const { return body_bytes_; }

    /// Zeros take no bytes in the file: they must not take many here.
    void check_zeros(std::size_t number) const;
    /// The first three numbers (of a scalar: the one) of each element.
    std::vector<Eigen::Vector3d> values_of(std::size_t number) const;
    /// All numbers of all elements.
    std::vector<double> numbers_of(std::size_t number) const;
    /// Whether some accessor reads where numbers of another one change. \p changing:
    /// those whose numbers do.
    bool do_overlap(const std::set<std::size_t>& changing) const;

private:
    [[noreturn]] void fail(const std::string& field, const std::string& what) const;
    std::uint32_t word(std::size_t at) const;
    void find_container();
    /// The bytes of a file beside; with a plan none, but the file.
    std::string read_beside(const std::string& uri, const std::string& where,
                            GltfLayout::Buffer& buffer);
    void read_buffers();
    void read_views();
    /// The bytes of a view that is not read yet, as they stand in the file.
    std::string_view compressed_bytes(const GltfJson::Json& place,
                                      const std::string& where) const;
    /// Gives a buffer that the file does not hold its bytes, all zero.
    void make_room(std::size_t buffer, const std::string& where);
    void unpack_view(const GltfJson::Json& packed, const GltfView& view,
                     const std::string& where);
    void unpack_primitives();
    void unpack_primitive(const GltfJson::Json& primitive, const GltfJson::Json& packed,
                          const std::string& where);
    std::size_t accessor_of(const GltfJson::Json& value, const std::string& where) const;
    /// Where \p count elements of \p bytes start in a view, checked against its end.
    std::uint64_t start_in(const GltfView& view, std::uint64_t offset,
                           std::uint64_t stride, std::uint64_t count, std::uint64_t bytes,
                           const std::string& where) const;
    Scalar component_type(const GltfJson::Json& object, const std::string& where) const;
    const GltfView& view_of(const GltfJson::Json& object, const std::string& where) const;
    void read_accessors();
    GltfSparse read_sparse(const GltfJson::Json& object, const GltfAccessor& accessor,
                           const std::string& where) const;
    /// That the elements that are told apart are there.
    void check_sparse(std::size_t number) const;

    GeometryFile& file_;
    Geometry& out_;
    GltfLayout& layout_;
    GltfPlan* plan_;
    const InputFile* input_;
    std::uint64_t file_bytes_;
    std::size_t chunk_size_ = 0;
    std::optional<GltfJson> json_;
    std::vector<std::uint64_t> declared_;               ///< byteLength of the buffers
    std::map<std::string, std::size_t> buffer_of_file_; ///< the first that names it
    std::vector<GltfView> views_;
    std::uint64_t body_bytes_ = 0;      ///< of all buffers up to here
    std::uint64_t file_body_bytes_ = 0; ///< of those that the file holds
};

} // namespace cellwarp::core
