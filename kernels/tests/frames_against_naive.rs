//! Every kernel over frames on every instruction set against its scalar twin, whole and in parts.

use meissner_kernels::{
    Band, Conv1x1, Conv3x3, ConvParts, ConvScratch, FeatureMap, Isa, KernelError, Kn2rowConv3x3,
    Kn2rowScratch, PooledConv3x3, PooledScratch, Region, TransposedConv2x2, View, WinogradConv3x3,
    WinogradTile, average_pool, global_average, max_pool_2x2,
};
use proptest::prelude::*;

use crate::naive::frames::{self as naive, Image};
use crate::values::values;

const TILES: [WinogradTile; 2] = [WinogradTile::Two, WinogradTile::Four];

/// One or two images and a layer of `places` over them.
fn case(places: usize, side: usize) -> impl Strategy<Value = (ConvParts, Vec<Image>)> {
    let channels = proptest::collection::vec(prop_oneof![3 => 1usize..6, 2 => 1usize..36], 1..=2);
    (1..=side, 1..=side, channels, 1usize..40).prop_flat_map(move |(height, width, channels, outputs)| {
        let images: Vec<_> = channels
            .iter()
            .map(|&c| {
                values(height * width * c).prop_map(move |values| Image {
                    height,
                    width,
                    channels: c,
                    values,
                })
            })
            .collect();
        (
            values(channels.iter().sum::<usize>() * outputs * places),
            proptest::option::of(values(outputs)),
            proptest::option::of((values(outputs), values(outputs))),
            any::<bool>(),
            images,
        )
            .prop_map(move |(weight, bias, norm, relu, images)| {
                (ConvParts { inputs: channels.clone(), outputs, weight, bias, norm, relu }, images)
            })
    })
}

/// A part of `height` x `width` from four fractions, corners on a grid of `tile`; maybe empty.
fn part(height: usize, width: usize, tile: usize, [a, b, c, d]: [f64; 4]) -> Region {
    let corner =
        |fraction: f64, size: usize| ((fraction * (size + tile) as f64) as usize / tile * tile).min(size);
    let (y0, y1) = (corner(a.min(b), height), corner(a.max(b), height));
    let (x0, x1) = (corner(c.min(d), width), corner(c.max(d), width));
    // An end at the map's edge may lie off the grid, a start may not.
    let (y0, x0) = (y0 / tile * tile, x0 / tile * tile);
    Region { y: y0, x: x0, height: y1 - y0, width: x1 - x0 }
}

fn fractions() -> impl Strategy<Value = [f64; 4]> {
    [0.0..1.0, 0.0..1.0, 0.0..1.0, 0.0..1.0]
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

const UNTOUCHED: f32 = 12345.0;

/// Runs `run` for the whole map and for `region`, into separate maps and into the middle channels
/// of wider ones: `expected` bits inside the region, unchanged values outside.
fn check(
    expected: &Image,
    region: Region,
    mut run: impl FnMut(Isa, Region, Band<'_>) -> Result<(), KernelError>,
) -> Result<(), TestCaseError> {
    let [height, width, channels] = [expected.height, expected.width, expected.channels];
    for isa in Isa::available() {
        for (region, before, after) in [(Region::all(height, width), 0, 0), (region, 0, 0), (region, 3, 2)] {
            let wide = Image::new([height, width, before + channels + after], |_, _, _| UNTOUCHED);
            let mut out = wide.to_map(1).unwrap();
            let band = out.band().channels(before, channels).unwrap();
            run(isa, region, band).unwrap();
            let inside = |y: usize, x: usize| {
                (region.y..region.y + region.height).contains(&y)
                    && (region.x..region.x + region.width).contains(&x)
            };
            let wanted = Image::new([height, width, before + channels + after], |y, x, c| {
                if inside(y, x) && (before..before + channels).contains(&c) {
                    expected.at(y as isize, x as isize, c - before)
                } else {
                    UNTOUCHED
                }
            });
            let got = Image::of(out.view());
            prop_assert_eq!(bits(&got.values), bits(&wanted.values), "{} {:?}", isa.name(), region);
        }
    }
    Ok(())
}

/// The images as maps; with `join`, as channels of one map.
fn maps(images: &[Image], join: bool) -> Vec<FeatureMap> {
    if !join {
        return images.iter().map(|image| image.to_map(1).unwrap()).collect();
    }
    let (height, width) = (images[0].height, images[0].width);
    let mut out =
        FeatureMap::zeros(height, width, images.iter().map(|image| image.channels).sum(), 1).unwrap();
    for y in 0..height {
        for x in 0..width {
            let pixel: Vec<f32> = images
                .iter()
                .flat_map(|image| (0..image.channels).map(move |c| image.at(y as isize, x as isize, c)))
                .collect();
            out.pixel_mut(y, x).copy_from_slice(&pixel);
        }
    }
    vec![out]
}

/// The views of `maps` that a layer over `images` reads.
fn views<'a>(images: &[Image], maps: &'a [FeatureMap]) -> Vec<View<'a>> {
    if maps.len() == images.len() {
        return maps.iter().map(FeatureMap::view).collect();
    }
    let mut first = 0;
    let view = |image: &Image| {
        first += image.channels;
        maps[0].view().channels(first - image.channels, image.channels).unwrap()
    };
    images.iter().map(view).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn a_3x3_convolution_is_the_same_bits_as_its_scalar_twin(
        (parts, images) in case(9, 19), join in any::<bool>(), at in fractions(),
    ) {
        let expected = naive::conv(&parts, 3, &images);
        let (conv, maps) = (Conv3x3::new(&parts).unwrap(), maps(&images, join));
        let views = views(&images, &maps);
        let region = part(expected.height, expected.width, 1, at);
        check(&expected, region, |isa, region, out| conv.run(isa, &views, region, out))?;
    }

    #[test]
    fn a_1x1_convolution_is_the_same_bits_as_its_scalar_twin(
        (parts, images) in case(1, 31), join in any::<bool>(), at in fractions(),
    ) {
        let expected = naive::conv(&parts, 1, &images);
        let (conv, maps) = (Conv1x1::new(&parts).unwrap(), maps(&images, join));
        let views = views(&images, &maps);
        let region = part(expected.height, expected.width, 1, at);
        check(&expected, region, |isa, region, out| conv.run(isa, &views, region, out))?;
    }

    #[test]
    fn a_transposed_convolution_is_the_same_bits_as_its_scalar_twin(
        (parts, images) in case(4, 17), join in any::<bool>(), at in fractions(),
    ) {
        let expected = naive::transposed(&parts, &images);
        let (conv, maps) = (TransposedConv2x2::new(&parts).unwrap(), maps(&images, join));
        let views = views(&images, &maps);
        let region = part(expected.height, expected.width, 2, at);
        check(&expected, region, |isa, Region { y, x, height, width }, out| {
            let inputs = Region { y: y / 2, x: x / 2, height: height / 2, width: width / 2 };
            conv.run(isa, &views, inputs, out)
        })?;
    }

    #[test]
    fn a_winograd_convolution_is_the_same_bits_as_its_scalar_twin(
        (parts, images) in case(9, 15), join in any::<bool>(), at in fractions(),
    ) {
        let maps = maps(&images, join);
        let views = views(&images, &maps);
        let mut scratch = ConvScratch::default();
        for tile in TILES {
            let expected = naive::winograd(&parts, tile, &images);
            let conv = WinogradConv3x3::new(&parts, tile).unwrap();
            let region = part(expected.height, expected.width, tile.size(), at);
            check(&expected, region, |isa, region, out| conv.run(isa, &views, region, out, &mut scratch))?;
        }
    }

    #[test]
    fn poolings_are_the_same_bits_as_their_scalar_twins(
        image in (1usize..12, 1usize..12, 1usize..36).prop_flat_map(|(height, width, channels)| {
            values(height * width * channels).prop_map(move |values| Image { height, width, channels, values })
        }),
        size in 1usize..4,
        at in fractions(),
    ) {
        let map = image.to_map(0).unwrap();
        if image.height > 1 && image.width > 1 {
            let expected = naive::max_pool_2x2(&image);
            let region = part(expected.height, expected.width, 1, at);
            check(&expected, region, |isa, region, out| max_pool_2x2(isa, map.view(), region, out))?;
        }
        if image.height >= size && image.width >= size {
            let expected = naive::average_pool(size, &image);
            let region = part(expected.height, expected.width, 1, at);
            check(&expected, region, |isa, region, out| average_pool(isa, size, map.view(), region, out))?;
        }
        for isa in Isa::available() {
            let mut got = vec![0.0; image.channels];
            global_average(isa, map.view(), &mut got).unwrap();
            prop_assert_eq!(bits(&got), bits(&naive::global_average(&image)), "{}", isa.name());
        }
    }
}

/// Several strips of rows, and three blocks of outputs that pass over each of them.
#[test]
fn a_convolution_of_many_strips_is_the_same_bits_as_its_scalar_twin() {
    let number = |i: usize| ((i as u64 * 7919) % 1009) as f32 / 500.0 - 1.0;
    let (size, inputs, outputs) = ([9, 303], vec![17, 2], 41);
    let image = |c: usize| Image::new([size[0], size[1], c], |y, x, i| number((y * size[1] + x) * c + i));
    let images = [image(17), image(2)];
    let weight = (0..outputs * 19 * 9).map(|i| number(i * i)).collect();
    let parts = ConvParts { inputs, outputs, weight, relu: true, ..ConvParts::default() };
    let (maps, conv) = (maps(&images, false), Conv3x3::new(&parts).unwrap());
    let views = views(&images, &maps);
    let expected = naive::conv(&parts, 3, &images);
    let region = Region { y: 2, x: 5, height: 7, width: 290 };
    check(&expected, region, |isa, region, out| conv.run(isa, &views, region, out)).unwrap();
    let (pooled, mut scratch) = (PooledConv3x3::new(conv.clone()), PooledScratch::default());
    let region = Region { y: 1, x: 3, height: 3, width: 147 };
    let run = |isa: Isa, region: Region, out: Band<'_>| pooled.run(isa, &views, region, out, &mut scratch);
    check(&naive::max_pool_2x2(&expected), region, run).unwrap();
}

#[test]
fn a_global_average_of_any_number_of_channels_is_the_same_bits_as_its_scalar_twin() {
    for channels in [16, 17, 33, 48, 49, 64, 65, 97, 130] {
        let image =
            Image::new([3, 5, channels], |y, x, c| ((y * 31 + x * 17 + c * 7) % 23) as f32 / 3.0 - 4.0);
        let map = image.to_map(0).unwrap();
        for isa in Isa::available() {
            let mut got = vec![UNTOUCHED; channels];
            global_average(isa, map.view(), &mut got).unwrap();
            assert_eq!(bits(&got), bits(&naive::global_average(&image)), "{channels}, {}", isa.name());
        }
    }
}

/// More tiles than one batch holds.
#[test]
fn a_winograd_convolution_of_many_tiles_is_the_same_bits_as_its_scalar_twin() {
    let size = [61, 70];
    let number = |i: usize| ((i as u64 * 7919) % 1009) as f32 / 500.0 - 1.0;
    let images = [1, 2].map(|c| Image::new([size[0], size[1], c], |y, x, c| number((y * 70 + x) * 3 + c)));
    let weight = (0..3 * 33 * 9).map(|i| number(i * i)).collect();
    let parts = ConvParts { inputs: vec![1, 2], outputs: 33, weight, ..ConvParts::default() };
    let maps = maps(&images, false);
    let views = views(&images, &maps);
    let mut scratch = ConvScratch::default();
    for tile in TILES {
        let expected = naive::winograd(&parts, tile, &images);
        let conv = WinogradConv3x3::new(&parts, tile).unwrap();
        let region = Region { y: 8, x: 4, height: 53, width: 60 };
        check(&expected, region, |isa, region, out| conv.run(isa, &views, region, out, &mut scratch))
            .unwrap();
    }
}

proptest! {
    /// The products of an image, before and after some pixels change.
    #[test]
    fn products_that_are_kept_give_the_same_bits_as_their_scalar_twin(
        (parts, images) in case(9, 9),
        moved in proptest::collection::vec((any::<prop::sample::Index>(), -2.0f32..2.0), 0..40),
        at in fractions(),
    ) {
        let channels = parts.inputs[0];
        let weight = parts.weight[..9 * channels * parts.outputs].to_vec();
        let parts = ConvParts { inputs: vec![channels], weight, ..parts };
        let conv = Kn2rowConv3x3::new(&parts).unwrap();
        let mut image = images[0].clone();
        let [height, width] = [image.height, image.width];
        let mut scratch = Kn2rowScratch::default();
        let mut products = FeatureMap::zeros(height, width, conv.products(), 1).unwrap();
        let mut pixels: Vec<usize> = (0..height * width).collect();
        for round in 0..2 {
            let (map, before) = (image.to_map(round).unwrap(), products.clone());
            for isa in Isa::available() {
                products = before.clone();
                let changed = pixels.iter().map(|&p| [p / width, p % width]);
                conv.update(isa, map.view(), changed, &mut products, &mut scratch).unwrap();
                let expected = naive::kn2row(&parts, &image);
                let region = part(height, width, 1, at);
                let products = products.view();
                check(&expected, region, |isa, region, out| conv.sum(isa, products, region, out))?;
            }
            pixels = moved.iter().map(|(at, _)| at.index(height * width)).collect();
            for (&pixel, &(_, value)) in pixels.iter().zip(&moved) {
                image.values[pixel * channels..][..channels].fill(value);
            }
        }
    }

    #[test]
    fn a_pooled_convolution_is_the_same_bits_as_one_after_the_other((parts, images) in case(9, 30), at in fractions()) {
        if images[0].height < 2 || images[0].width < 2 {
            return Ok(());
        }
        let expected = naive::max_pool_2x2(&naive::conv(&parts, 3, &images));
        let maps: Vec<_> = images.iter().map(|image| image.to_map(1).unwrap()).collect();
        let views: Vec<_> = maps.iter().map(FeatureMap::view).collect();
        let pooled = PooledConv3x3::new(Conv3x3::new(&parts).unwrap());
        let mut scratch = PooledScratch::default();
        let region = part(expected.height, expected.width, 1, at);
        check(&expected, region, |isa, region, out| pooled.run(isa, &views, region, out, &mut scratch))?;
    }

    #[test]
    fn a_second_map_of_zeros_may_be_left_out(
        (parts, image) in (1usize..6, 1usize..6, 1usize..40).prop_flat_map(|(a, b, o)| (
            (values(9 * (a + b) * o), values(o)).prop_map(move |(weight, bias)| ConvParts {
                inputs: vec![a, b], outputs: o, weight, bias: Some(bias), ..ConvParts::default()
            }),
            (1usize..5, 1usize..20)
                .prop_flat_map(move |(h, w)| (Just([h, w, a]), values(h * w * a))),
        )),
    ) {
        let ([height, width, _], values) = (image.0, &image.1);
        let x = FeatureMap::from_pixels(image.0, 1, values).unwrap();
        let zeros = FeatureMap::zeros(height, width, parts.inputs[1], 1).unwrap();
        let conv = Conv3x3::new(&parts).unwrap();
        let region = Region::all(height, width);
        for isa in Isa::available() {
            let (mut with, mut without) = (
                FeatureMap::zeros(height, width, parts.outputs, 0).unwrap(),
                FeatureMap::zeros(height, width, parts.outputs, 0).unwrap(),
            );
            conv.run(isa, &[x.view(), zeros.view()], region, with.band()).unwrap();
            conv.run(isa, &[x.view()], region, without.band()).unwrap();
            let all = |map: &FeatureMap| bits(&naive::Image::of(map.view()).values);
            prop_assert_eq!(all(&with), all(&without), "{}", isa.name());
        }
    }
}
