// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/gl.h"

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <string>
#include <tuple>

namespace cellwarp::core
{

namespace
{

GLuint compiled(GLenum kind, const char* text)
{
    const GLuint shader = glCreateShader(kind);
    glShaderSource(shader, 1, &text, nullptr);
    glCompileShader(shader);
    GLint is_good = 0;
    glGetShaderiv(shader, GL_COMPILE_STATUS, &is_good);
    if (!is_good)
    {
        char words[2048] = "";
        glGetShaderInfoLog(shader, sizeof words, nullptr, words);
        throw std::logic_error(std::string("a shader does not compile: ") + words);
    }
    return shader;
}

} // namespace

ShaderProgram::ShaderProgram(const char* vertex, const char* fragment)
    : id_(glCreateProgram())
{
    for (const GLuint shader :
         {compiled(GL_VERTEX_SHADER, vertex), compiled(GL_FRAGMENT_SHADER, fragment)})
    {
        glAttachShader(id_, shader);
        glDeleteShader(shader); // once the program is
    }
    glLinkProgram(id_);
    GLint is_good = 0;
    glGetProgramiv(id_, GL_LINK_STATUS, &is_good);
    if (!is_good)
    {
        char words[2048] = "";
        glGetProgramInfoLog(id_, sizeof words, nullptr, words);
        throw std::logic_error(std::string("shaders do not fit: ") + words);
    }
}

ShaderProgram::~ShaderProgram()
{
    glDeleteProgram(id_);
}

void ShaderProgram::set(const char* name, float value) const
{
    glUniform1f(place(name), value);
}

void ShaderProgram::set(const char* name, int value) const
{
    glUniform1i(place(name), value);
}

void ShaderProgram::set(const char* name, float x, float y, float z, float w) const
{
    glUniform4f(place(name), x, y, z, w);
}

void ShaderProgram::set_matrix(const char* name, const float* columns) const
{
    glUniformMatrix4fv(place(name), 1, GL_FALSE, columns);
}

void GpuBuffer::reserve(std::size_t bytes)
{
    bind();
    glBufferData(target_, static_cast<GLsizeiptr>(bytes), nullptr, GL_STREAM_DRAW);
    bytes_ = bytes;
}

void GpuBuffer::write(const void* data, std::size_t bytes, std::size_t start)
{
    bind();
    glBufferSubData(target_, static_cast<GLintptr>(start), static_cast<GLsizeiptr>(bytes),
                    data);
}

void GpuBuffer::fill(const void* data, std::size_t bytes)
{
    reserve(bytes);
    if (bytes == 0)
        return;
    void* memory = glMapBufferRange(target_, 0, static_cast<GLsizeiptr>(bytes),
                                    GL_MAP_WRITE_BIT | GL_MAP_INVALIDATE_BUFFER_BIT);
    if (memory != nullptr)
    {
        std::memcpy(memory, data, bytes);
        if (glUnmapBuffer(target_))
            return;
    }
    write(data, bytes, 0);
}

void VertexArray::floats(GLuint index, const GpuBuffer& buffer, int count, int stride,
                         std::size_t start, bool is_per_instance) const
{
    bind();
    buffer.bind();
    glEnableVertexAttribArray(index);
    glVertexAttribPointer(index, count, GL_FLOAT, GL_FALSE, stride,
                          reinterpret_cast<const void*>(start));
    glVertexAttribDivisor(index, is_per_instance ? 1 : 0);
}

void VertexArray::colours(GLuint index, const GpuBuffer& buffer, int stride,
                          std::size_t start, bool is_per_instance) const
{
    bind();
    buffer.bind();
    glEnableVertexAttribArray(index);
    glVertexAttribPointer(index, 4, GL_UNSIGNED_BYTE, GL_TRUE, stride,
                          reinterpret_cast<const void*>(start));
    glVertexAttribDivisor(index, is_per_instance ? 1 : 0);
}

void VertexArray::constant(GLuint index) const
{
    bind();
    glDisableVertexAttribArray(index);
}

Offscreen::Offscreen(int samples) : samples_(samples)
{
    GLint most = 0;
    glGetIntegerv(GL_MAX_SAMPLES, &most);
    is_good_ = samples == 1 || most > 1;
    samples_ = samples == 1 ? 0 : std::min(most, samples);
    glGenFramebuffers(1, &frame_);
    glGenRenderbuffers(1, &colour_);
    glGenRenderbuffers(1, &depth_);
}

Offscreen::~Offscreen()
{
    glDeleteFramebuffers(1, &frame_);
    glDeleteRenderbuffers(1, &colour_);
    glDeleteRenderbuffers(1, &depth_);
}

bool Offscreen::begin(int width, int height)
{
    if (!is_good_)
        return false;
    glBindFramebuffer(GL_FRAMEBUFFER, frame_);
    if (width != width_ || height != height_)
    {
        width_ = width;
        height_ = height;
        for (const auto& [buffer, format, place] :
             {std::tuple(colour_, GL_RGBA8, GL_COLOR_ATTACHMENT0),
              std::tuple(depth_, GL_DEPTH_COMPONENT24, GL_DEPTH_ATTACHMENT)})
        {
            glBindRenderbuffer(GL_RENDERBUFFER, buffer);
            glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples_, format, width,
                                             height);
            glFramebufferRenderbuffer(GL_FRAMEBUFFER, place, GL_RENDERBUFFER, buffer);
        }
        is_good_ = glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
    }
    if (!is_good_)
        glBindFramebuffer(GL_FRAMEBUFFER, 0);
    return is_good_;
}

void Offscreen::copy_to(GLuint frame, int x, int y) const
{
    glDisable(GL_SCISSOR_TEST);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, frame_);
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, frame);
    glBlitFramebuffer(0, 0, width_, height_, x, y, x + width_, y + height_,
                      GL_COLOR_BUFFER_BIT, GL_NEAREST);
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
}

} // namespace cellwarp::core
