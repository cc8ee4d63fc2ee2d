// SPDX-License-Identifier: GPL-3.0-or-later
// The few objects of OpenGL 3.3 that the canvas is made of, each owned by one value. All
// of it needs a current context, also to be destroyed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#define GL_GLEXT_PROTOTYPES
#include <GL/glcorearb.h>

namespace cellwarp::core
{

/// A program of one vertex and one fragment shader. That they do not compile is a bug:
/// std::logic_error with the driver's words.
class ShaderProgram
{
public:
    ShaderProgram(const char* vertex, const char* fragment);
    ~ShaderProgram();
    ShaderProgram(const ShaderProgram&) = delete;
    ShaderProgram& operator=(const ShaderProgram&) = delete;

    void use() const { glUseProgram(id_); }
    /// To be called after use(). A name that the program does not need is left out.
    void set(const char* name, float value) const;
    void set(const char* name, int value) const;
    void set(const char* name, float x, float y, float z, float w) const;
    void set_matrix(const char* name, const float* columns) const; ///< 4x4

private:
    GLint place(const char* name) const { return glGetUniformLocation(id_, name); }
    GLuint id_ = 0;
};

/// Memory of the graphics card that is filled anew as a whole, or in parts.
class GpuBuffer
{
public:
    explicit GpuBuffer(GLenum target) : target_(target) { glGenBuffers(1, &id_); }
    ~GpuBuffer() { glDeleteBuffers(1, &id_); }
    GpuBuffer(const GpuBuffer&) = delete;
    GpuBuffer& operator=(const GpuBuffer&) = delete;

    void bind() const { glBindBuffer(target_, id_); }
    /// Leaves the old memory to what is still drawn from it and copies into a new one.
    void fill(const void* data, std::size_t bytes);
    /// The same without the copy.
    void reserve(std::size_t bytes);
    /// Copies a part of what was reserved, from \p start on [byte].
    void write(const void* data, std::size_t bytes, std::size_t start);
    std::size_t bytes() const { return bytes_; }

private:
    GLenum target_;
    GLuint id_ = 0;
    std::size_t bytes_ = 0;
};

/// Which buffers the attributes of a vertex come from.
class VertexArray
{
public:
    VertexArray() { glGenVertexArrays(1, &id_); }
    ~VertexArray() { glDeleteVertexArrays(1, &id_); }
    VertexArray(const VertexArray&) = delete;
    VertexArray& operator=(const VertexArray&) = delete;

    void bind() const { glBindVertexArray(id_); }
    /// Attribute \p index: \p count floats of each vertex, \p stride bytes apart, or of
    /// each instance.
    void floats(GLuint index, const GpuBuffer& buffer, int count, int stride = 0,
                std::size_t start = 0, bool is_per_instance = false) const;
    /// Attribute \p index: four bytes that stand for 0 to 1.
    void colours(GLuint index, const GpuBuffer& buffer, int stride = 0,
                 std::size_t start = 0, bool is_per_instance = false) const;
    /// The attribute has one value for all vertices: the one of glVertexAttrib.
    void constant(GLuint index) const;

private:
    GLuint id_ = 0;
};

/// A picture beside the window's: what is drawn there can be copied again and again.
class Offscreen
{
public:
    /// \p samples: 1, or several a pixel, whatever the window has.
    explicit Offscreen(int samples);
    ~Offscreen();
    Offscreen(const Offscreen&) = delete;
    Offscreen& operator=(const Offscreen&) = delete;

    /// Drawing goes there from now on; false where the driver cannot.
    bool begin(int width, int height);
    GLuint frame() const { return frame_; }
    /// Copies it into another picture of one sample a pixel (0: the window's), its lower
    /// left corner to (\p x, \p y). Drawing goes to the window from now on.
    void copy_to(GLuint frame, int x, int y) const;

private:
    GLuint frame_ = 0, colour_ = 0, depth_ = 0;
    int samples_, width_ = 0, height_ = 0;
    bool is_good_ = true;
};

} // namespace cellwarp::core
