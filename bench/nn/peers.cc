// SPDX-License-Identifier: Apache-2.0
#include "peers.h"

#ifdef TILEGRAD_HAVE_OPENBLAS
#include <cblas.h>
#endif
#ifdef TILEGRAD_HAVE_ONEDNN
#include <omp.h>

#include <oneapi/dnnl/dnnl.hpp>
#endif

namespace tilegrad::nn::bench {

#ifdef TILEGRAD_HAVE_OPENBLAS
GemmPeer OpenBlasPeer() {
  return {"openblas", [](const GemmProblem<float>& p) {
            openblas_set_num_threads(1);
            const auto op = [](bool transposed) { return transposed ? CblasTrans : CblasNoTrans; };
            cblas_sgemm(CblasRowMajor, op(p.transpose_a), op(p.transpose_b), static_cast<int>(p.m),
                        static_cast<int>(p.n), static_cast<int>(p.k), 1.0f, p.a,
                        static_cast<int>(p.lda), p.b, static_cast<int>(p.ldb), 0.0f, p.c,
                        static_cast<int>(p.ldc));
          }};
}
#else
GemmPeer OpenBlasPeer() { return {"openblas", nullptr}; }
#endif

#ifdef TILEGRAD_HAVE_ONEDNN
GemmPeer OneDnnPeer() {
  return {"onednn", [](const GemmProblem<float>& p) {
            omp_set_num_threads(1);
            const auto size = [](std::size_t extent) { return static_cast<dnnl_dim_t>(extent); };
            dnnl::sgemm(p.transpose_a ? 'T' : 'N', p.transpose_b ? 'T' : 'N', size(p.m), size(p.n),
                        size(p.k), 1.0f, p.a, size(p.lda), p.b, size(p.ldb), 0.0f, p.c,
                        size(p.ldc));
          }};
}

namespace {

using Memory = dnnl::memory;

struct ConvDescriptors {
  explicit ConvDescriptors(const Conv2dShape& s)
      : x(Any({s.batch, s.in_channels, s.in_height, s.in_width})),
        weight(Any({s.out_channels, s.in_channels, s.kernel_height, s.kernel_width})),
        y(Any({s.batch, s.out_channels, s.out_height(), s.out_width()})),
        strides(2, static_cast<Memory::dim>(s.stride)),
        padding(2, static_cast<Memory::dim>(s.padding)) {}
  static Memory::desc Any(const std::vector<std::size_t>& extents) {
    return {Memory::dims(extents.begin(), extents.end()), Memory::data_type::f32,
            Memory::format_tag::any};
  }
  Memory::desc x, weight, y;
  Memory::dims strides, padding;
};

}  // namespace

struct OneDnnConv::Impl {
  dnnl::engine engine{dnnl::engine::kind::cpu, 0};
  dnnl::stream stream{engine};
  dnnl::primitive primitive;
  std::unordered_map<int, Memory> arguments;

  void Add(int name, const Memory::desc& description) {
    Memory memory(description, engine);
    std::fill_n(static_cast<float*>(memory.get_data_handle()), memory.get_desc().get_size() / 4,
                0.5f);
    arguments.emplace(name, std::move(memory));
  }
};

OneDnnConv::OneDnnConv(const Conv2dShape& shape, ConvPass pass) : impl_(std::make_unique<Impl>()) {
  omp_set_num_threads(1);
  const ConvDescriptors d(shape);
  const auto direct = dnnl::algorithm::convolution_direct;
  const dnnl::convolution_forward::primitive_desc forward(
      {dnnl::prop_kind::forward_training, direct, d.x, d.weight, d.y, d.strides, d.padding,
       d.padding},
      impl_->engine);
  if (pass == ConvPass::kForward) {
    impl_->primitive = dnnl::convolution_forward(forward);
    impl_->Add(DNNL_ARG_SRC, forward.src_desc());
    impl_->Add(DNNL_ARG_WEIGHTS, forward.weights_desc());
    impl_->Add(DNNL_ARG_DST, forward.dst_desc());
  } else if (pass == ConvPass::kInputGrad) {
    const dnnl::convolution_backward_data::primitive_desc p(
        {direct, d.x, d.weight, d.y, d.strides, d.padding, d.padding}, impl_->engine, forward);
    impl_->primitive = dnnl::convolution_backward_data(p);
    impl_->Add(DNNL_ARG_DIFF_SRC, p.diff_src_desc());
    impl_->Add(DNNL_ARG_WEIGHTS, p.weights_desc());
    impl_->Add(DNNL_ARG_DIFF_DST, p.diff_dst_desc());
  } else {
    const dnnl::convolution_backward_weights::primitive_desc p(
        {direct, d.x, d.weight, d.y, d.strides, d.padding, d.padding}, impl_->engine, forward);
    impl_->primitive = dnnl::convolution_backward_weights(p);
    impl_->Add(DNNL_ARG_SRC, p.src_desc());
    impl_->Add(DNNL_ARG_DIFF_WEIGHTS, p.diff_weights_desc());
    impl_->Add(DNNL_ARG_DIFF_DST, p.diff_dst_desc());
  }
}

bool OneDnnConv::available() { return true; }
void OneDnnConv::Run() {
  impl_->primitive.execute(impl_->stream, impl_->arguments);
  impl_->stream.wait();
}
#else
GemmPeer OneDnnPeer() { return {"onednn", nullptr}; }
struct OneDnnConv::Impl {};
OneDnnConv::OneDnnConv(const Conv2dShape&, ConvPass) {}
bool OneDnnConv::available() { return false; }
void OneDnnConv::Run() {}
#endif

OneDnnConv::~OneDnnConv() = default;

}  // namespace tilegrad::nn::bench
