//! Files over HTTP and HTTPS.

use std::error::Error;

use reqwest::header::{CONTENT_TYPE, LOCATION};
use reqwest::{Response, StatusCode, Url};

use super::address::NotPublic;
use super::{Sources, Told, collect, failed, private, refused};
use crate::error::ApiError;

/// Most redirects that are followed.
const MAX_REDIRECTS: usize = 5;

/// The file and its content type.
pub(super) async fn get(
    sources: &Sources,
    mut url: Url,
    limit: u64,
    told: Told<'_>,
) -> Result<(Vec<u8>, Option<String>), ApiError> {
    for _ in 0..=MAX_REDIRECTS {
        let answer = ask(sources, url.clone()).await?;
        if let Some(next) = redirect(&url, &answer)? {
            sources.check(&next)?;
            url = next;
            continue;
        }
        check_status(answer.status())?;
        let content_type = answer.headers().get(CONTENT_TYPE).and_then(|value| value.to_str().ok()).map(str::to_owned);
        let announced = answer.content_length();
        let bytes = collect(answer.bytes_stream(), announced, limit, sources.patience, told).await?;
        return Ok((bytes, content_type));
    }
    Err(refused(&format!("more than {MAX_REDIRECTS} redirects")))
}

async fn ask(sources: &Sources, url: Url) -> Result<Response, ApiError> {
    let asked = tokio::time::timeout(sources.patience, sources.client()?.get(url).send());
    match asked.await {
        Ok(Ok(answer)) => Ok(answer),
        Ok(Err(error)) if is_not_public(&error) => Err(private()),
        Ok(Err(error)) => {
            tracing::info!(cause = ?error.without_url(), "a source cannot be reached");
            Err(failed("the other server cannot be reached"))
        }
        Err(_) => Err(failed("the other server does not answer")),
    }
}

fn is_not_public(error: &(dyn Error + 'static)) -> bool {
    std::iter::successors(Some(error), |&error| error.source()).any(|error| error.is::<NotPublic>())
}

/// Where an answer says that the file is instead.
fn redirect(url: &Url, answer: &Response) -> Result<Option<Url>, ApiError> {
    if !matches!(answer.status().as_u16(), 301 | 302 | 303 | 307 | 308) {
        return Ok(None);
    }
    let location = answer.headers().get(LOCATION).and_then(|value| value.to_str().ok());
    let next = location.and_then(|location| url.join(location).ok());
    match next {
        Some(next) if matches!(next.scheme(), "http" | "https") => Ok(Some(next)),
        _ => Err(failed("the other server redirects to nowhere")),
    }
}

fn check_status(status: StatusCode) -> Result<(), ApiError> {
    match status.as_u16() {
        200 => Ok(()),
        404 | 410 => Err(refused("the other server has no such file")),
        401 | 403 => Err(refused("the other server does not give the file to this one")),
        code @ 400..=499 if code != 429 => Err(refused(&format!("the other server refuses with {code}"))),
        code => Err(failed(&format!("the other server answers {code}"))),
    }
}
